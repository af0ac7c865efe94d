"""A CO2 sensor that drifts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Effect, Parameter, Values


def _contribution(xp: Any, drivers: Drivers, parameters: Values, _memory: Array) -> Mapping[str, Array]:
    return {"air_co2": parameters["drift"] / 30.0 * drivers["elapsed_days"]}


EFFECT = Effect(
    name="co2_drift",
    kind="sensor",
    balances=(),
    drivers=("elapsed_days",),
    parameters=(Parameter("drift", "ppm (30 d)-1", 40.0, -500.0, 500.0, "what it reads more after 30 days"),),
    contribution=_contribution,
    signature="the reading runs away slowly, no balance answers",
    separating_test="hold a calibrated hand sensor beside it, twice, a week apart",
    title="a CO2 sensor that drifts",
    sentence="the CO2 sensor drifts: {value} ppm more each 30 days",
    opposite="the CO2 sensor drifts: {value} ppm less each 30 days",
    source="sensor practice",
    measured=("air_co2",),
)
