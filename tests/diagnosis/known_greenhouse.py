"""A virtual greenhouse that was calibrated on its own weeks, and the weeks after them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from igrow.core.arrays import Floats
from igrow.core.telemetry import Telemetry, concatenate
from igrow.trainer.calibration import calibrate
from igrow.trainer.data import Log, prepare_log
from igrow.trainer.diagnosis import DEFAULT
from igrow.trainer.diagnosis.search import history
from igrow.trainer.fit import FittedModel
from tests.made_once import made_once
from tests.virtual_log import SITE, disturbances, virtual_log

STEP, DAYS, KNOWN = 900.0, 44, 24
"""Seconds between readings, days of all weeks, and of those that the model was calibrated on."""


def weeks(parameters: Mapping[str, float] | None = None, added: Mapping[str, Floats] | None = None) -> Telemetry:
    """Return all weeks, of a greenhouse with other parameters, or with further fluxes by channel, (n,)."""
    fluxes = disturbances(DAYS, STEP, seed=5)
    for channel, flux in (added or {}).items():
        fluxes[channel] = fluxes.get(channel, 0.0) + flux
    return virtual_log(DAYS, seed=5, step=STEP, added=fluxes, parameters=parameters)


@made_once
def calibrated() -> FittedModel:
    """Return the model of the greenhouse as it was, with its history."""
    plain = weeks()
    before = prepare_log(plain.select(end=plain.time[0] + np.timedelta64(KNOWN, "D")), SITE)
    fitted = calibrate(before)
    return replace(fitted, history=history.history_of(before.record(fitted.alignment or 0.0), fitted, DEFAULT))


def later(before: Telemetry, after: Telemetry, begins: int = 0) -> Log:
    """Return the weeks after the calibration, as they were until a day and as they are from it on."""
    first = before.time[0] + np.timedelta64(KNOWN, "D")
    cut = first + np.timedelta64(begins, "D")
    return prepare_log(concatenate([before.select(first, cut), after.select(start=cut)]), SITE)
