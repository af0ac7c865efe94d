"""Units as people write them: the registry's ``W m-2 K-1`` is ``W/(m² K)`` on a page."""

from __future__ import annotations

import re

_SIGNS = {"degC": "°C", "deg": "°", "umol": "µmol", "1": "", "m2": "m²", "m3": "m³"}
_POWER = re.compile(r"^(\(.+\)|[A-Za-z%°µ]+)(-?\d+(?:\.\d+)?)$")
_FACTOR = re.compile(r"\([^)]*\)-?\d*|\S+")
_RAISED = {"2": "²", "3": "³", "4": "⁴"}


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
