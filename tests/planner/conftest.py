"""The site, the weather and the recipe of the toy greenhouse."""

from __future__ import annotations

import numpy as np
import pytest

from igrow.core.planner import PlanningState
from igrow.core.site import Site
from tests.planner.toy_greenhouse import HOURS, START
from tests.setpoint_tables import OPTIONAL


@pytest.fixture
def site() -> Site:
    """The default site, which chooses three setpoints."""
    return Site("toy", 52.0, 4.5, "Europe/Amsterdam")


@pytest.fixture
def weather() -> np.ndarray:
    """Two winter days, (48, 6)."""
    hour = np.arange(HOURS) % 24
    sun = np.maximum(np.sin((hour - 8) / 9 * np.pi), 0.0) * ((hour >= 8) & (hour <= 17)) * 250.0
    rows = [4.0 + 3.0 * (sun > 0), np.full(HOURS, 85.0), np.full(HOURS, 410.0), sun, np.full(HOURS, 4.0)]
    return np.column_stack([*rows, np.full(HOURS, -5.0)])


@pytest.fixture
def recipe() -> np.ndarray:
    """A grower's two days, (48, S)."""
    hour = np.arange(HOURS) % 24
    day = (hour >= 7) & (hour < 19)
    rows = [np.where(day, 20.0, 17.0), np.where(day, 600.0, 400.0), 1.0 * day, 0.5 * day]
    rows += [np.full(HOURS, value) for value in OPTIONAL]
    return np.column_stack(rows)


@pytest.fixture
def state() -> PlanningState:
    return PlanningState(START, {"air_temperature": 18.0})
