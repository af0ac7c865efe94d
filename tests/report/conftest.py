"""Diagnoses to report: one of a leak, and logs that are no good, by the clock of Amsterdam."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from igrow.trainer.data import Log, prepare_log
from igrow.trainer.diagnosis import Diagnosis, diagnose
from igrow.trainer.report import figures, render_report
from tests.diagnosis.conftest import DAYS, STEP, greenhouse_log, model_in_force
from tests.made_once import made_once
from tests.virtual_log import SITE, weather

HOME = replace(SITE, time_zone="Europe/Amsterdam")


@pytest.fixture(scope="session")
@made_once
def leak() -> Diagnosis:
    """Wind presses 0.12 air changes per hour and m/s in; a night of humidity is stuck."""
    wind = weather(DAYS, STEP, 2)["wind_speed"]
    log = greenhouse_log(2, {"air_exchange": 0.12 * wind * SITE.greenhouse.mean_height / 3600.0})
    humidity = np.array(log.telemetry["air_humidity"])
    humidity[500:560] = 71.0
    table = log.telemetry.with_columns({"air_humidity": humidity})
    return diagnose(prepare_log(table, HOME), replace(model_in_force(), site=HOME))


@pytest.fixture(scope="session")
def stuck() -> Diagnosis:
    """The temperature sensor stands still for most of the log."""
    log = greenhouse_log(1)
    air = np.array(log.telemetry["air_temperature"])
    air[300:] = 19.5
    table = log.telemetry.with_columns({"air_temperature": air})
    return diagnose(prepare_log(table, HOME), replace(model_in_force(), site=HOME))


@pytest.fixture(scope="session")
def undosed() -> Log:
    """A log without its CO2 dosing."""
    log = greenhouse_log(1)
    return replace(log, site=HOME).without("co2_dosing")


@pytest.fixture
def without_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reports of words alone: to draw the figures takes more than a second for each page."""
    for name in ("overview", "evidence"):
        monkeypatch.setattr(figures, name, lambda *_: [])


@pytest.fixture(scope="session")
def page_in(leak: Diagnosis) -> Callable[[str], str]:
    """The report of the leak in a language, drawn once."""
    return functools.cache(lambda code: render_report(leak, code))


@pytest.fixture(scope="session")
def page(page_in: Callable[[str], str]) -> str:
    """The report of the leak."""
    return page_in("en")
