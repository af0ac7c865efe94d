"""Heat that leaves the pipes later than the measured pipe temperature tells."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Effect, Parameter, Values, lagged


def _contribution(xp: Any, drivers: Drivers, parameters: Values, memory: Array) -> Mapping[str, Array]:
    return {"heat": parameters["exchange"] * (memory - drivers["rail_pipe_excess"])}


EFFECT = Effect(
    name="pipe_lag",
    kind="process",
    balances=("heat",),
    drivers=("rail_pipe_excess",),
    parameters=(
        Parameter("exchange", "W m-2 K-1", 1.0, 0.0, 4.0, "heat per kelvin of the pipe that comes late"),
        Parameter("time_constant", "min", 30.0, 5.0, 180.0, "time by which it comes late"),
    ),
    contribution=_contribution,
    signature="too little heat after the pipe warms and too much after it cools, nothing in between",
    separating_test="raise the minimum pipe temperature by 10 K for an hour and back",
    title="pipes that heat with a delay",
    sentence="the pipes heat with a delay: {value} W/m2 for each kelvin comes late",
    source="De Zwart (1996), thesis Wageningen, ch. 3: dynamics of the heating pipes",
    memory=lagged(lambda _xp, drivers: drivers["rail_pipe_excess"], "time_constant", 60.0),
)
