"""Units as people write and use them: the registry's ``W m-2 K-1`` is ``W/(m² K)`` on a page, ``degC`` may be °F."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Units = Literal["metric", "us"]

_SIGNS = {"degC": "°C", "deg": "°", "umol": "µmol", "1": "", "m2": "m²", "m3": "m³"}
_POWER = re.compile(r"^(\(.+\)|[A-Za-z%°µ]+)(-?\d+(?:\.\d+)?)$")
_FACTOR = re.compile(r"\([^)]*\)-?\d*|\S+")
_RAISED = {"2": "²", "3": "³", "4": "⁴"}


@dataclass(frozen=True)
class Shown:
    """How a quantity is shown: value x factor + offset, in another unit."""

    unit: str
    factor: float = 1.0
    offset: float = 0.0

    def of(self, value: float) -> float:
        """Return a value of the registry as it is shown."""
        return value * self.factor + self.offset

    def all(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return values of the registry as they are shown, any shape."""
        return values * self.factor + self.offset

    def back(self, value: float) -> float:
        """Return a value that people gave in the registry's unit."""
        return (value - self.offset) / self.factor


US: Mapping[str, Shown] = {
    "degC": Shown("°F", 1.8, 32.0),
    "K": Shown("°F", 1.8),
    "m s-1": Shown("mph", 3600.0 / 1609.344),
    "MJ": Shown("BTU", 1e6 / 1055.05585262),
    "g": Shown("oz", 1.0 / 28.349523125),
    "m2": Shown("ft²", 1.0 / 0.3048**2),
    "kg m-2": Shown("lb/ft²", 0.3048**2 / 0.45359237),
    "kg m-2 h-1": Shown("lb/(ft² h)", 0.3048**2 / 0.45359237),
    "L m-2 h-1": Shown("gal/(ft² h)", 0.3048**2 / 3.785411784),
    "g m-2 h-1": Shown("oz/(ft² h)", 0.3048**2 / 28.349523125),
    "g m-2 h-1 kPa-1": Shown("oz/(ft² h kPa)", 0.3048**2 / 28.349523125),
    "W m-2 K-1": Shown("W/(m² °F)", 1.0 / 1.8),
    "h-1 (m s-1)-1": Shown("1/(h mph)", 1609.344 / 3600.0),
    "m s-1 K-0.5": Shown("mph/√°F", 3600.0 / 1609.344 / 1.8**0.5),
}
"""What growers in the United States use in place of a unit of the registry; exact by NIST Special Publication 811. The
power for an area stays in W/m², as their climate computers have the sun's."""
US_WORDS: Mapping[str, str] = {
    **dict.fromkeys(("kelvin", "Kelvin", "一开尔文", "开尔文"), "°F"),
    **dict.fromkeys(("g/m2", "g/m²"), "oz/ft²"),
    "m/s": "mph",
}
"""Words of sentences that name a part of such a unit: for each kelvin, per m/s of wind."""


def written(unit: str) -> str:
    """Return a unit with a stroke for what is divided by, and raised powers."""
    if unit in _SIGNS:
        return _SIGNS[unit]
    above: list[str] = []
    below: list[str] = []
    for factor in _FACTOR.findall(unit):
        found = _POWER.match(factor)
        base, power = (found[1], found[2]) if found else (factor, "1")
        inside = f"({written(base[1:-1])})" if base.startswith("(") else _SIGNS.get(base, base)
        (below if power.startswith("-") else above).append(_raised(inside, power.lstrip("-")))
    if not below:
        return " ".join(above)
    under = " ".join(below)
    return f"{' '.join(above) or '1'}/{f'({under})' if len(below) > 1 else under}"


def _raised(base: str, power: str) -> str:
    if power == "1":
        return base
    return f"√{base}" if power == "0.5" else f"{base}{_RAISED.get(power, f'^{power}')}"
