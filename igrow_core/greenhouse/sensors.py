"""What the sensors make of the truth: white noise and a resolution for each quantity."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from igrow.core.arrays import Array

DEFAULT_NOISE: Mapping[str, tuple[float, float]] = MappingProxyType(
    {
        "air_temperature": (0.05, 0.1),
        "air_humidity": (0.4, 0.1),
        "air_co2": (6.0, 1.0),
        "rail_pipe_temperature": (0.2, 0.1),
        "grow_pipe_temperature": (0.2, 0.1),
        "outdoor_temperature": (0.05, 0.1),
        "outdoor_humidity": (0.5, 0.1),
        "global_radiation": (1.0, 1.0),
        "wind_speed": (0.1, 0.1),
    }
)
"""Standard deviation and resolution by quantity, in its unit: fair instruments of a commercial greenhouse."""


@dataclass(frozen=True)
class Sensors:
    """Noise by quantity; one that is not named is read exactly."""

    noise: Mapping[str, tuple[float, float]] = field(default_factory=lambda: DEFAULT_NOISE)
    """Name -> (standard deviation, resolution; 0 is none), in the quantity's unit."""

    def draw(self, rng: np.random.Generator, count: int | None) -> dict[str, Array]:
        """Draw the noise of one reading of every sensor: name -> float, or array (N,) for a batch."""
        if not self.noise:
            return {}
        names = list(self.noise)
        drawn = rng.standard_normal(len(names) if count is None else (len(names), count))
        values = drawn.tolist() if count is None else drawn
        return {name: self.noise[name][0] * value for name, value in zip(names, values, strict=True)}

    def reading(self, name: str, value: Array, noise: Mapping[str, Array]) -> Array:
        """Return what the sensor shows: value plus noise, rounded to its resolution, in its physical range."""
        if name not in self.noise:
            return value
        shown = value + noise.get(name, 0.0)
        resolution = self.noise[name][1]
        if isinstance(shown, float):
            shown = round(shown / resolution) * resolution if resolution > 0.0 else shown
            if name in _BOUNDED:
                low, high = _BOUNDED[name]
                shown = min(max(shown, low), high)
            return shown
        if resolution > 0.0:
            shown = np.round(shown / resolution) * resolution
        return np.clip(shown, *_BOUNDED[name]) if name in _BOUNDED else shown


_BOUNDED = {
    "air_humidity": (0.0, 100.0),
    "outdoor_humidity": (0.0, 100.0),
    "global_radiation": (0.0, 2000.0),
    "wind_speed": (0.0, 60.0),
}

EXACT = Sensors(MappingProxyType({}))
"""Sensors that show the truth."""
