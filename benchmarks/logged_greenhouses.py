"""The season's greenhouses with what makes a log: disturbances, sensor noise, and a row every five minutes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.season_greenhouses import BEFORE, DAY, SEED, START, Greenhouse, Greenhouses
from igrow.core.arrays import Array
from igrow.core.greenhouse.disturbances import Disturbances
from igrow.core.greenhouse.parameters import stack
from igrow.core.greenhouse.plant import Plant
from igrow.core.greenhouse.weather_table import WeatherTable
from igrow.core.sun import unix_seconds
from igrow.core.telemetry import Telemetry

LATER = 7
"""Day of the season, counted from 0, with which each greenhouse's second undeclared effect begins."""
STEP = 300
"""Seconds between two rows."""


@dataclass(frozen=True)
class SharedDisturbances(Disturbances):
    """What disturbs a greenhouse, the same in each of its copies: ways are compared, not their luck."""

    copies: int = 1
    """Of all greenhouses, one set after the other."""

    def innovate(self, rng: np.random.Generator, count: int | None) -> list[Array]:
        """Draw one set of innovations; see `Disturbances`."""
        drawn = super().innovate(rng, (count or 1) // self.copies)
        return [np.tile(one, self.copies) for one in drawn]


class LoggedPlant(Plant):
    """A plant whose sensors are read every five minutes."""

    rows: list[dict[str, Array]]

    def advance(self, seconds: float, setpoints: Mapping[str, Array]) -> None:
        """Carry the plant on and keep what its sensors show, actuators as means of five minutes."""
        for _ in range(round(seconds / STEP)):
            self.reset_means()
            super().advance(STEP, setpoints)
            self.rows.append(self.measured(self.truth(setpoints)))


class LoggedGreenhouses(Greenhouses):
    """The season's greenhouses, disturbed, with noisy sensors; of two undeclared effects the second begins later."""

    plant: LoggedPlant
    hidden: list[tuple[str, str]]
    """Names of what stands and of what begins, by row."""

    def stand(self, each: Sequence[Greenhouse]) -> LoggedPlant:
        """Return the plant that these greenhouses are."""
        self.hidden = [(one.effects[0].name, one.effects[1].name) for one in each]
        plant = LoggedPlant(
            stack([one.parameters for one in each]),
            WeatherTable([one.weather for one in each]),
            float(unix_seconds(START - BEFORE * DAY)),
            count=len(each),
            effects=[[one.effects[0], replace(one.effects[1], start=START + LATER * DAY)] for one in each],
            disturbances=SharedDisturbances(copies=len(each) // len({id(one) for one in each})),
            seed=SEED,
        )
        plant.rows = []
        return plant

    def telemetry(self, row: int, first: int, last: int) -> Telemetry:
        """Return the log of a row's greenhouse, from one day of the season to another."""
        per_day = 86_400 // STEP
        rows = self.plant.rows[(first + BEFORE) * per_day : (last + BEFORE) * per_day]
        begin = START + first * DAY
        time = begin + (1 + np.arange(len(rows))) * np.timedelta64(STEP, "s")
        columns = {
            name: np.array([np.broadcast_to(one[name], len(self.hidden))[row] for one in rows]) for name in rows[0]
        }
        return Telemetry(time, columns)
