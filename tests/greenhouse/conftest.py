"""Two weeks of generated weather, in winter and in spring."""

from __future__ import annotations

import pytest

from igrow.core.greenhouse import generate_weather
from igrow.core.telemetry import Telemetry
from tests.greenhouse.greenhouse_seasons import SPRING, WINTER, hours


@pytest.fixture(scope="session")
def winter() -> Telemetry:
    return generate_weather(WINTER, WINTER + hours(24 * 15), seed=5)


@pytest.fixture(scope="session")
def spring() -> Telemetry:
    return generate_weather(SPRING, SPRING + hours(24 * 15), seed=7)
