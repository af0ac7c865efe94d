"""What a policy learns in, a day at a time, each greenhouse under weather of its own.

`DailyGreenhouses` are mechanistic greenhouses (`Greenhouses`, which any strategy can lead). `SimulatedDays` is a
bundle's simulator: some hundred times cheaper, and what the paper trains on; whether that carries over to a
greenhouse is then to be judged in the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from igrow.core.agronomy import Memory, one_of
from igrow.core.arrays import Floats
from igrow.core.economics import Balance
from igrow.core.greenhouse import GreenhouseParameters, generate_weather
from igrow.core.greenhouse.disturbances import QUIET
from igrow.core.greenhouse.parameters import stack
from igrow.core.greenhouse.plant import Plant
from igrow.core.greenhouse.sensors import EXACT
from igrow.core.greenhouse.weather_table import WeatherTable
from igrow.core.planner.objective import Objective, Outcome, Simulator, Valuation
from igrow.core.planner.optimise import RADIATION
from igrow.core.planner.plant_simulator import run
from igrow.core.planner.policy import HOURS, PRESENT, observe
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


class World(Protocol):
    """Greenhouses that live through days, one action each day."""

    @property
    def done(self) -> bool:
        """All days are over."""

    def observe(self) -> NDArray[np.float32]:
        """Return the observations of the day that comes, (N, 76)."""

    def step(self, setpoints: Setpoints) -> Valuation:
        """Live through a day under setpoints (N, 24, 4), and return what it was worth, arrays (1, N)."""


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


class SimulatedDays:
    """A simulator under `count // trials` courses of weather, in each of which `trials` actions are tried a day.

    The first of them is followed: the climate at its end begins the next day. Leaf area and fruit load are drawn for
    each course and stay, as a day changes them little.
    """

    def __init__(self, site: Site, scenario: Scenario, simulator: Simulator, trials: int = 8) -> None:
        rng = np.random.default_rng(scenario.seed)
        self.site, self.scenario, self.trials, self.day = site, scenario, trials, 0
        self._simulator = simulator
        courses = max(1, scenario.count // trials)
        end = scenario.start + (scenario.days + 1) * DAY
        weather = [generate_weather(scenario.start, end, seed=int(rng.integers(2**31))) for _ in range(courses)]
        self._forecast = np.stack([hourly_weather(table, scenario.start, 24 * scenario.days) for table in weather])
        self._state = [
            {
                "air_temperature": float(rng.uniform(16.0, 22.0)),
                "air_humidity": float(rng.uniform(65.0, 90.0)),
                "air_co2": float(rng.uniform(400.0, 900.0)),
                "leaf_area_index": float(rng.uniform(2.0, 4.0)),
                "plant_load": float(rng.uniform(100.0, 500.0)),
            }
            for _ in range(courses)
        ]

    @property
    def done(self) -> bool:
        """All days are over."""
        return self.day >= self.scenario.days

    def observe(self) -> NDArray[np.float32]:
        """Return the observations of the day that comes, (N, 76), equal for the trials of one course."""
        day = min(self.day, self.scenario.days - 1)
        forecast = self._forecast[:, day * HOURS : (day + 1) * HOURS]
        present = {name: np.array([state[name] for state in self._state]) for name in PRESENT}
        return observe(self.site, present, forecast, self.scenario.start + day * DAY).repeat(self.trials, axis=0)

    def step(self, setpoints: Setpoints) -> Valuation:
        """Try a day's setpoints (N, 24, 4), and return what each was worth, arrays (1, N)."""
        start = self.scenario.start + self.day * DAY
        objective = Objective(self.site, start + np.arange(HOURS) * np.timedelta64(3600, "s"))
        template = for_site(self.site, start, HOURS)
        limited = template.limit(setpoints, np.full(4, np.nan))
        parts = []
        for course, state in enumerate(self._state):
            tried = limited[course * self.trials : (course + 1) * self.trials]
            forecast = self._forecast[course, self.day * HOURS : (self.day + 1) * HOURS]
            outcome = self._simulator.simulate(state, forecast, tried, start)
            parts.append(objective.value(outcome))
            for name in ("air_temperature", "air_humidity", "air_co2"):
                state[name] = float(getattr(outcome, name)[0, 0, -1])
        self.day += 1
        return join(parts)


def join(parts: Sequence[Valuation]) -> Valuation:
    """Put valuations of candidates side by side."""

    def side(arrays: Sequence[Floats]) -> Floats:
        return np.concatenate(arrays, axis=1)

    return Valuation(
        Balance(**{one.name: side([getattr(part.balance, one.name) for part in parts]) for one in fields(Balance)}),
        side([part.harm for part in parts]),
        side([part.outside for part in parts]),
    )


def hourly_weather(weather: Telemetry, start: np.datetime64, hours: int) -> Floats:
    """Return hourly means from `start` on in the registry's order, (H, 6); `start` is a whole hour."""
    table = to_grid(weather.select(start, start + np.timedelta64(hours, "h")), 3600)
    return np.stack([table[name] for name in WEATHER[:6]], axis=1)
