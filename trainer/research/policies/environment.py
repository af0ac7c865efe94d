"""Where a policy is judged: mechanistic greenhouses, each under weather of its own, which any strategy can lead."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from igrow.core.agronomy import Memory, one_of
from igrow.core.arrays import Floats
from igrow.core.greenhouse import GreenhouseParameters, generate_weather
from igrow.core.greenhouse.disturbances import QUIET
from igrow.core.greenhouse.parameters import stack
from igrow.core.greenhouse.plant import Plant
from igrow.core.greenhouse.sensors import EXACT
from igrow.core.greenhouse.weather_table import WeatherTable
from igrow.core.planner.objective import Objective, Outcome, Valuation
from igrow.core.planner.optimise import RADIATION
from igrow.core.planner.plant_simulator import run
from igrow.core.planner.policy import HOURS, observe
from igrow.core.planner.template import Setpoints, for_site
from igrow.core.quantities import WEATHER
from igrow.core.site import Site
from igrow.core.sun import unix_seconds
from igrow.core.telemetry import Telemetry, to_grid

DAY = np.timedelta64(86_400, "s")
BEFORE, AHEAD = 3, 3
"""Days of weather before the first day, from which a forecast can be made, and beyond the last one."""


@dataclass(frozen=True)
class Scenario:
    """Which greenhouses and which weather: the same seed gives the same ones."""

    start: np.datetime64
    """UTC; local midnight of the first day."""
    days: int
    count: int
    seed: int
    variation: float = 0.08
    """Relative spread of the greenhouses' parameters."""
    copies: int = 1
    """How often each greenhouse stands there, so that methods can be compared in one batch: N = count * copies."""


class Greenhouses:
    """A batch of mechanistic greenhouses, each under weather of its own, led hour by hour."""

    def __init__(self, site: Site, scenario: Scenario, parameters: GreenhouseParameters | None = None) -> None:
        rng = np.random.default_rng(scenario.seed)
        self.site, self.time = site, scenario.start
        begin, end = scenario.start - BEFORE * DAY, scenario.start + (scenario.days + AHEAD) * DAY
        self.weather = [generate_weather(begin, end, seed=int(rng.integers(2**31))) for _ in range(scenario.count)]
        self.weather *= scenario.copies
        base = parameters or GreenhouseParameters()
        varied = [base.varied(rng, relative=scenario.variation) for _ in range(scenario.count)]
        self.count = scenario.count * scenario.copies
        self._start = scenario.start
        hours = 24 * (scenario.days + AHEAD)
        self._hourly = np.stack([hourly_weather(table, scenario.start, hours) for table in self.weather])
        self._plant = Plant(
            stack(varied * scenario.copies),
            WeatherTable(self.weather),
            float(unix_seconds(scenario.start)),
            count=self.count,
            disturbances=QUIET,
            sensors=EXACT,
        )
        self._applied = np.full((self.count, 4), np.nan)
        self._memory: Memory | None = None

    def measurements(self) -> dict[str, Floats]:
        """Return the present truth by quantity, (N,) each; actuators as means of the last hour."""
        like = np.zeros(self.count)
        return {name: like + value for name, value in self._plant.truth({}).items()}

    def coming_weather(self, hours: int) -> Floats:
        """Return the weather that the next hours will bring, (N, hours, 6), up to `AHEAD` days beyond the end."""
        first = int((self.time - self._start) // np.timedelta64(1, "h"))
        return self._hourly[:, first : first + hours]

    def applied(self) -> Floats:
        """Return the setpoints of the last hour, (N, 4), NaN before the first."""
        return self._applied

    def advance(self, setpoints: Setpoints) -> Outcome:
        """Live through hours under setpoints (N, H, 4) within all limits; returns what happened, (1, N, H)."""
        hours = setpoints.shape[1]
        radiation = self.coming_weather(hours)[:, :, RADIATION].mean(axis=0)
        template = for_site(self.site, self.time, hours, radiation=radiation)
        course = template.follow(setpoints, self._applied, self._memory)
        self._applied, self._memory = course.setpoints[:, -1], course.memory
        self.time = self.time + hours * np.timedelta64(3600, "s")
        return run(self._plant, course.setpoints)

    def memory(self, greenhouse: int) -> Memory | None:
        """Return what one crop has had, as its limits count it."""
        return None if self._memory is None else one_of(self._memory, greenhouse)


class DailyGreenhouses:
    """Mechanistic greenhouses that live through `days` days, one action each day."""

    def __init__(self, site: Site, scenario: Scenario) -> None:
        self._greenhouses, self._days, self.day = Greenhouses(site, scenario), scenario.days, 0

    @property
    def done(self) -> bool:
        """All days are over."""
        return self.day >= self._days

    def observe(self) -> NDArray[np.float32]:
        """Return the observations of the day that comes, (N, 76)."""
        known = self._greenhouses
        return observe(known.site, known.measurements(), known.coming_weather(HOURS), known.time)

    def step(self, setpoints: Setpoints) -> Valuation:
        """Live through a day under setpoints (N, 24, 4), and return what it was worth, arrays (1, N)."""
        time = self._greenhouses.time + np.arange(HOURS) * np.timedelta64(3600, "s")
        self.day += 1
        return Objective(self._greenhouses.site, time).value(self._greenhouses.advance(setpoints))


def hourly_weather(weather: Telemetry, start: np.datetime64, hours: int) -> Floats:
    """Return hourly means from `start` on in the registry's order, (H, 6); `start` is a whole hour."""
    table = to_grid(weather.select(start, start + np.timedelta64(hours, "h")), 3600)
    return np.stack([table[name] for name in WEATHER[:6]], axis=1)
