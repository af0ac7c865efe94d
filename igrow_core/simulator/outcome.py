"""What every simulator says of candidates, in whatever way it works: climate, resources, growth and harvest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Protocol

import numpy as np

from igrow.core.arrays import Floats, Times


@dataclass(frozen=True)
class Outcome:
    """What B candidates do over H hours, by each of M members of an ensemble; all arrays (M, B, H).

    A simulator without an ensemble has M = 1. Amounts belong to the hour, they are not cumulative.
    """

    air_temperature: Floats
    """degC, mean of the hour or its end."""
    air_humidity: Floats
    """%."""
    air_co2: Floats
    """ppm."""
    heat: Floats
    """MJ m-2."""
    electricity: Floats
    """kWh m-2."""
    co2: Floats
    """kg m-2 dosed."""
    net_growth: Floats
    """kg m-2 of dry matter."""
    fruit_fresh_weight: Floats
    """kg m-2 harvested."""
    leaf_area_index: Floats
    """m2 m-2 of the leaves that grew it."""
    outside: Floats
    """How far the hour lies outside the training data, in widths of its range; 0 inside."""

    def first(self, hours: int) -> Outcome:
        """Return what happens in the first hours."""
        return Outcome(**{one.name: getattr(self, one.name)[..., :hours] for one in fields(self)})

    def of(self, candidates: slice) -> Outcome:
        """Return what some of the candidates do."""
        return Outcome(**{one.name: getattr(self, one.name)[:, candidates] for one in fields(self)})

    def last(self, hours: int) -> Outcome:
        """Return what happens in the last hours."""
        return Outcome(**{one.name: getattr(self, one.name)[..., -hours:] for one in fields(self)})


Initial = Mapping[str, float | Floats]
"""Present value of quantities (climate, growth, yield, actuators) in the registry's units, and ``mean_air_temperature``
of the day before; one number for all candidates, or one for each of them, (B,)."""


class Simulator(Protocol):
    """Anything that says what setpoints do: a bundle's graph, a model in numpy, the mechanistic greenhouse."""

    @property
    def setpoints(self) -> tuple[str, ...]:
        """Setpoints that do anything in it, in the registry's order; plans choose no other."""

    def simulate(self, initial: Initial, weather: Floats, setpoints: Floats, start: np.datetime64 | Times) -> Outcome:
        """Return what candidates do.

        Args:
            initial: what is known of the present; what is not is as usual.
            weather: (H, 6), the hours' means of `quantities.WEATHER`'s first six, in its order; or each candidate's
                own, (B, H, 6).
            setpoints: (B, H, S), in the order of `quantities.SETPOINTS`.
            start: UTC time at which the first hour begins; or each candidate's own, (B,).
        """
