"""What a policy learns in: a bundle's simulator, one day a step, as a gymnasium environment.

A day is worth what it earns more than the grower's recipe does from the same state under the same weather (both are
simulated at once), so that a dull day's low income is no one's fault. Leaf area and fruit load are drawn for each
episode and stay, as a day changes them little; the climate at the end of a day begins the next.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import gymnasium
import numpy as np
from numpy.typing import NDArray

from igrow.core.agronomy import Memory, one_of
from igrow.core.greenhouse import generate_weather, hourly_weather, recipe_by_hour
from igrow.core.planner.objective import Objective
from igrow.core.planner.optimise import RADIATION
from igrow.core.planner.template import BLOCK_STARTS, for_site
from igrow.core.quantities import SETPOINTS
from igrow.core.simulator.outcome import Simulator
from igrow.core.site import Site
from igrow.trainer.research.policies.policy import (
    ACTIONS,
    HOURS,
    OBSERVATIONS,
    PAPER_SETPOINTS,
    PRESENT,
    chosen,
    observe,
    to_setpoints,
)

DAY = np.timedelta64(86_400, "s")
FIRST_START = np.datetime64("2020-01-04T23:00:00", "s")
LAST_START_DAYS = 110
"""Episodes begin on a day up to this long after the first start."""
EPISODE = 5
"""Days of an episode; no two of them have the same weather."""
TRAINING_SEEDS = 1_000_000
"""Seeds of training weather begin here; tests and benchmarks use smaller ones."""
BLOCKS = np.searchsorted(np.array(BLOCK_STARTS), np.arange(HOURS), side="right") - 1
"""Block of the day of each hour, (24,); hours before the first block's start belong to the last one."""
LEVELS = len(BLOCK_STARTS) * len(PAPER_SETPOINTS)
"""Numbers that are learnt: a level of each setpoint in each block."""
EUROS = 20.0
"""Reward of a euro: gains of a day are some EUR 0.05 m-2."""


class Start(NamedTuple):
    """Where a day begins."""

    time: np.datetime64
    state: dict[str, float]
    applied: NDArray[np.float64]
    memory: Memory | None


def by_hour(levels: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return actions (B, 96), hour by hour, of levels (B, 32), block by block."""
    blocks = levels.reshape(len(levels), len(BLOCK_STARTS), len(PAPER_SETPOINTS))
    return blocks[:, BLOCKS].reshape(len(levels), ACTIONS)


class SimulatedDays(gymnasium.Env):  # type: ignore[misc]
    """Days of a greenhouse that a simulator knows; actions are levels of blocks of the day, -1 to 1, (32,)."""

    def __init__(self, site: Site, simulator: Simulator, seed: int = 0) -> None:
        self.site, self._simulator = site, simulator
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (OBSERVATIONS,), np.float32)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (LEVELS,), np.float32)
        self._rng = np.random.default_rng((TRAINING_SEEDS, seed))
        self._weather = np.empty((0, HOURS, 6))
        self._day = 0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode at a random date, in random weather and with a random crop."""
        super().reset(seed=seed)
        if seed is not None:
            self._rng = np.random.default_rng((TRAINING_SEEDS, seed))
        rng = self._rng
        start = FIRST_START + int(rng.integers(LAST_START_DAYS)) * DAY
        weather = generate_weather(start, start + (EPISODE + 1) * DAY, seed=TRAINING_SEEDS + int(rng.integers(2**30)))
        self._weather = hourly_weather(weather, start, HOURS * (EPISODE + 1)).reshape(-1, HOURS, 6)
        state = {
            "air_temperature": float(rng.uniform(16.0, 22.0)),
            "air_humidity": float(rng.uniform(65.0, 90.0)),
            "air_co2": float(rng.uniform(400.0, 900.0)),
            "leaf_area_index": float(rng.uniform(2.0, 4.0)),
            "plant_load": float(rng.uniform(100.0, 500.0)),
        }
        self._day, self._start = 0, Start(start, state, np.full(len(SETPOINTS), np.nan), None)
        return self._observe(), {}

    def step(self, action: NDArray[np.float32]) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Live a day; the reward is what it is worth more than a day by the recipe."""
        now, weather = self._start, self._weather[self._day]
        time = now.time + np.arange(HOURS) * np.timedelta64(3600, "s")
        recipe = recipe_by_hour(now.time, HOURS, self.site.longitude)
        asked = chosen(self.site, to_setpoints(self.site, by_hour(action[None])), recipe)
        template = for_site(self.site, now.time, HOURS, radiation=weather[:, RADIATION])
        # Both in one batch, which costs the simulator as much as one.
        course = template.follow(np.stack([asked[0], recipe]), now.applied, now.memory)
        outcome = self._simulator.simulate(dict(now.state), weather, course.setpoints, now.time)
        score = Objective(self.site, time).value(outcome).score.mean(axis=0)
        state = now.state | {
            name: float(getattr(outcome, name)[0, 0, -1]) for name in ("air_temperature", "air_humidity", "air_co2")
        }
        self._start = Start(now.time + DAY, state, course.setpoints[0, -1], one_of(course.memory, 0))
        self._day += 1
        # The greenhouse goes on; only the episode ends.
        return self._observe(), EUROS * float(score[0] - score[1]), False, self._day >= EPISODE, {}

    def _observe(self) -> NDArray[np.float32]:
        present = {name: np.array([self._start.state[name]]) for name in PRESENT}
        seen = observe(self.site, present, self._weather[None, self._day], self._start.time)
        return np.asarray(seen[0])
