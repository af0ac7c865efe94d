"""What no model knows: coloured, heavy-tailed fluxes of heat, vapour and CO2 into the air."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from igrow.core.arrays import Array
from igrow.core.namespace import namespace

INTERVAL = 300.0
"""Seconds between two innovations."""
NORMAL = 1e6
"""Degrees of freedom from which Student's t is the normal."""


@dataclass(frozen=True)
class Disturbances:
    """An autoregressive process of first order for each balance; sizes are standard deviations.

    In a batch each value may be an array of shape (N,).
    """

    heat: Array = 4.0
    """W m-2."""
    vapour: Array = 4.0
    """g m-2 h-1."""
    co2: Array = 0.25
    """g m-2 h-1."""
    correlation_hours: Array = 2.0
    """Time in which the autocorrelation falls to 1/e, h."""
    degrees_of_freedom: Array | None = None
    """Of Student's t for the innovations (at least 2.5; scaled to the same deviation); None is the normal."""

    def innovate(self, rng: np.random.Generator, count: int | None) -> list[Array]:
        """Draw one set of innovations: heat W m-2, vapour and CO2 kg m-2 s-1, scaled for `INTERVAL`."""
        xp = namespace(count)
        shape = (3,) if count is None else (3, count)
        if self.degrees_of_freedom is None:
            drawn = rng.standard_normal(shape)
        else:
            freedom = xp.maximum(self.degrees_of_freedom, 2.5)
            drawn = rng.standard_t(freedom, shape) / xp.sqrt(freedom / (freedom - 2.0))
        scale = xp.sqrt(1.0 - self.persistence(count) ** 2)
        sizes = (self.heat, self.vapour / 3.6e6, self.co2 / 3.6e6)
        return [
            size * scale * value for size, value in zip(sizes, drawn.tolist() if count is None else drawn, strict=True)
        ]

    def persistence(self, count: int | None) -> Array:
        """Return what is left of a disturbance after one `INTERVAL`, 0 to 1."""
        return namespace(count).exp(-INTERVAL / (3600.0 * self.correlation_hours))


QUIET = Disturbances(heat=0.0, vapour=0.0, co2=0.0)
"""No disturbances at all."""


def combined(each: Sequence[Disturbances]) -> Disturbances:
    """Return the disturbances of a batch, from those of each greenhouse."""
    values = {one.name: [getattr(own, one.name) for own in each] for one in fields(Disturbances)}
    values["degrees_of_freedom"] = [NORMAL if one is None else one for one in values["degrees_of_freedom"]]
    return Disturbances(**{name: np.array(column) for name, column in values.items()})
