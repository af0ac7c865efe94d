"""Logs of a virtual greenhouse with known truth, shared by the tests of the diagnosis."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from igrow.core.telemetry import Telemetry
from igrow.trainer.data import Log, prepare_log
from igrow.trainer.diagnosis import Diagnosis, diagnose
from igrow.trainer.fit import FittedModel, Gaussian
from tests.diagnosis import known_greenhouse
from tests.made_once import made_once
from tests.virtual_log import GREENHOUSE, SITE, virtual_log, weather

Floats = NDArray[np.float64]
DAYS = 20
STEP = 900.0


def disturbances(days: int, step: float, seed: int) -> dict[str, Floats]:
    """Coloured fluxes that no model knows: correlation time of two hours."""
    generator = np.random.default_rng(seed)
    count = round(days * 86_400 / step)
    keep = float(np.exp(-step / 7200.0))
    sizes = {"heat": 4.0, "vapour": 1e-6, "co2": 6e-8}
    return {
        name: size * np.sqrt(1.0 - keep**2) * lfilter([1.0], [1.0, -keep], generator.standard_normal(count))
        for name, size in sizes.items()
    }


@made_once
def greenhouse_log(
    seed: int,
    added: Mapping[str, Floats] | None = None,
    days: int = DAYS,
    followed: Mapping[str, Floats] | None = None,
) -> Log:
    """A log with disturbances, sensor noise, what is added to the fluxes, and setpoints that are followed instead."""
    fluxes = disturbances(days, STEP, seed)
    for channel, flux in (added or {}).items():
        fluxes[channel] = fluxes.get(channel, 0.0) + flux
    measured = virtual_log(days, seed=seed, step=STEP, added=fluxes, followed=followed, measures_leaves=True)
    return prepare_log(measured, SITE)


def model_in_force() -> FittedModel:
    """A model that knows the greenhouse's parameters within five per cent, and not what it misses there."""
    values = GREENHOUSE
    deviation = {name: 0.05 * abs(value) + 1e-6 for name, value in values.items()}
    return FittedModel(SITE, Gaussian.independent(values, deviation), SITE.name, alignment=0.0)


@pytest.fixture(scope="session")
def quiet_log() -> Log:
    """Nothing is missing."""
    return greenhouse_log(1)


@pytest.fixture(scope="session")
@made_once
def quiet_diagnosis() -> Diagnosis:
    """What is said of a log in which nothing is missing."""
    return diagnose(greenhouse_log(1), model_in_force())


@pytest.fixture(scope="session")
def leaky_log() -> Log:
    """Wind presses 0.12 air changes per hour and m/s more through the envelope than the model knows."""
    wind = weather(DAYS, STEP, 15)["wind_speed"]
    return greenhouse_log(15, {"air_exchange": 0.12 * wind * SITE.greenhouse.mean_height / 3600.0})


@pytest.fixture(scope="session")
def door_log() -> Log:
    """A door stands open from 7 to 16 h on working days: no effect of the catalogue."""
    count = round(DAYS * 86_400 / STEP)
    hours = np.arange(count) * STEP / 3600.0
    # The log begins on a Saturday.
    weekday = (5 + np.floor(hours / 24.0)) % 7
    opened = (hours % 24.0 >= 7.0) & (hours % 24.0 < 16.0) & (weekday < 5)
    return greenhouse_log(3, {"air_exchange": 0.003 * opened})


@pytest.fixture(scope="session")
def known_weeks() -> Telemetry:
    """All weeks of the greenhouse that was calibrated on its own, as it was."""
    return known_greenhouse.weeks()


@pytest.fixture(scope="session")
def known_model() -> FittedModel:
    """What was calibrated on the first of them, with its history."""
    return known_greenhouse.calibrated()
