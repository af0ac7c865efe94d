"""Vents that follow a reversal of their command only after some play."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Effect, EffectMemory, Parameter, Values


def _opening(drivers: Drivers) -> Array:
    return 0.5 * (drivers["vent_lee"] + drivers["vent_wind"])


def _start(_xp: Any, drivers: Drivers, _parameters: Values) -> Array:
    return _opening(drivers)


def _advance(xp: Any, memory: Array, drivers: Drivers, parameters: Values, _seconds: float) -> Array:
    opening, play = _opening(drivers), parameters["play"]
    return xp.minimum(xp.maximum(memory, opening - play), opening + play)


def _contribution(xp: Any, drivers: Drivers, parameters: Values, memory: Array) -> Mapping[str, Array]:
    opening = 0.5 * (drivers["vent_lee"] + drivers["vent_wind"])
    missing = (memory - opening) / xp.maximum(opening, 2.0)
    return {"air_exchange": parameters["share"] * drivers["ventilation"] * missing}


EFFECT = Effect(
    name="vent_backlash",
    kind="process",
    balances=("heat", "vapour", "co2"),
    drivers=("vent_lee", "vent_wind", "ventilation"),
    parameters=(
        Parameter("share", "1", 0.7, 0.0, 1.5, "share of the vents that has the play"),
        Parameter("play", "%", 3.0, 0.5, 15.0, "half the play of the drive"),
    ),
    contribution=_contribution,
    signature="hysteresis: after each reversal the exchange stays what it was for a while",
    separating_test="move the vents from 10 to 20 % and back in steps of 2 % in steady weather",
    title="vents that answer late when they turn back",
    sentence="the vents answer late when they turn back (share {value})",
    source="general practice: play of rack-and-pinion vent drives",
    memory=EffectMemory(_start, _advance, within_step=True),
)
