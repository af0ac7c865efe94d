"""A humidity sensor that drifts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Effect, Parameter, Values


def _contribution(xp: Any, drivers: Drivers, parameters: Values, _memory: Array) -> Mapping[str, Array]:
    return {"air_humidity": parameters["drift"] / 30.0 * drivers["elapsed_days"]}


EFFECT = Effect(
    name="humidity_drift",
    kind="sensor",
    balances=(),
    drivers=("elapsed_days",),
    parameters=(Parameter("drift", "% (30 d)-1", 4.0, -40.0, 40.0, "what it reads more after 30 days"),),
    contribution=_contribution,
    signature="the reading runs away slowly, no balance answers",
    separating_test="hold a calibrated hand sensor beside it, twice, a week apart",
    title="a humidity sensor that drifts",
    sentence="the humidity sensor drifts: {value} % more each 30 days",
    opposite="the humidity sensor drifts: {value} % less each 30 days",
    source="sensor practice",
    measured=("air_humidity",),
)
