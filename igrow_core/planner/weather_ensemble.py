"""A simulator under several courses of weather at once, so that a plan holds against their spread."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from igrow.core.arrays import Floats, Times
from igrow.core.simulator.outcome import Initial, Outcome, Simulator


@dataclass(frozen=True)
class WeatherEnsemble:
    """Runs candidates under each of W courses of weather; its ensemble is that of the simulator under each, (W M)."""

    simulator: Simulator
    courses: Sequence[Floats]
    """Each (H, 6), hourly means."""

    @property
    def setpoints(self) -> tuple[str, ...]:
        """Those of the simulator."""
        return self.simulator.setpoints

    def simulate(self, initial: Initial, weather: Floats, setpoints: Floats, start: np.datetime64 | Times) -> Outcome:
        """Return what candidates do; see `igrow.core.simulator.outcome.Simulator`.

        `weather` is not read: the courses stand for it.
        """
        outcomes = [self.simulator.simulate(initial, course, setpoints, start) for course in self.courses]
        return Outcome(
            **{part.name: np.concatenate([getattr(one, part.name) for one in outcomes]) for part in fields(Outcome)}
        )
