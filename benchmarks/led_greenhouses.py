"""Mechanistic greenhouses, each under weather of its own, that any strategy can lead; and what came of the hours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.provenance import ROOT
from igrow.core.agronomy import Memory, one_of
from igrow.core.arrays import Floats
from igrow.core.greenhouse import GreenhouseParameters, generate_weather, hourly_weather
from igrow.core.greenhouse.disturbances import QUIET
from igrow.core.greenhouse.parameters import stack
from igrow.core.greenhouse.plant import Plant
from igrow.core.greenhouse.sensors import EXACT
from igrow.core.greenhouse.weather_table import WeatherTable
from igrow.core.planner.optimise import RADIATION
from igrow.core.planner.template import Setpoints, for_site
from igrow.core.quantities import SETPOINTS, USUAL_SETPOINTS
from igrow.core.simulator.outcome import Outcome
from igrow.core.site import Site
from igrow.core.sun import unix_seconds

SITE = ROOT / "config" / "site.yaml"
"""The described greenhouse, from which they differ."""
DAY = np.timedelta64(86_400, "s")
BEFORE, AHEAD = 3, 3
"""Days of weather before the first day, from which a forecast can be made, and beyond the last one."""
_TOTALS = {"heat": ("boiler_in", 1e-6), "electricity": ("electricity", 1 / 3.6e6), "co2": ("co2_dosed", 1.0)}
_STATES = ("air_temperature", "air_humidity", "air_co2", "leaf_area_index")
_CUMULATIVE = ("net_growth", "fruit_fresh_weight")


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
        self._applied = np.full((self.count, len(SETPOINTS)), np.nan)
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
        """Return the setpoints of the last hour, (N, S), NaN before the first."""
        return self._applied

    def advance(self, setpoints: Setpoints) -> Outcome:
        """Live through hours under setpoints (N, H, S) within all limits; returns what happened, (1, N, H)."""
        hours = setpoints.shape[1]
        radiation = self.coming_weather(hours)[:, :, RADIATION].mean(axis=0)
        template = for_site(self.site, self.time, hours, radiation=radiation)
        course = template.follow(setpoints, self._applied, self._memory)
        self._applied, self._memory = course.setpoints[:, -1], course.memory
        self.time = self.time + hours * np.timedelta64(3600, "s")
        return run(self._plant, course.setpoints, self.site.setpoints)

    def memory(self, greenhouse: int) -> Memory | None:
        """Return what one crop has had, as its limits count it."""
        return None if self._memory is None else one_of(self._memory, greenhouse)


def run(plant: Plant, setpoints: Floats, taken: Sequence[str] = USUAL_SETPOINTS) -> Outcome:
    """Carry a batch of B plants along setpoints (B, H, S); arrays (1, B, H), climate as of each hour's end.

    `taken` are the setpoints that the plants' computers take; the others they have of their own.
    """
    columns: dict[str, list[Any]] = {name: [] for name in (*_STATES, *_TOTALS, *_CUMULATIVE)}
    before = _books(plant)
    for hour in range(setpoints.shape[1]):
        command = {name: setpoints[:, hour, SETPOINTS.index(name)] for name in taken}
        # Actuators are read as means: those of the last hour, when the hours are over.
        plant.reset_means()
        plant.advance(3600.0, command)
        after = _books(plant)
        for name in _STATES:
            columns[name].append(after[name])
        for name in (*_TOTALS, *_CUMULATIVE):
            columns[name].append(after[name] - before[name])
        before = after
    arrays = {name: np.stack(values, axis=-1)[None] for name, values in columns.items()}
    return Outcome(**arrays, outside=np.zeros_like(arrays["heat"]))


def _books(plant: Plant) -> dict[str, Floats]:
    truth = plant.truth({})
    like = np.zeros(plant.count or 1)
    books = {name: like + truth[name] for name in (*_STATES, *_CUMULATIVE)}
    for name, (total, scale) in _TOTALS.items():
        books[name] = like + plant.state.totals.get(total, 0.0) * scale
    return books
