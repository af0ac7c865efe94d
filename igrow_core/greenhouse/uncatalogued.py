"""Causes that the catalogue does not hold: a diagnosis should say so, and not give them a name from its list.

They have the same form as the catalogue's effects and one driver more, `weekday` (0 is Monday, local solar date).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from igrow.core.air import LATENT_HEAT
from igrow.core.arrays import Array
from igrow.core.effects import Effect, EffectMemory, Parameter
from igrow.core.effects.definition import Balance, Drivers, Values

_SOURCE = "invented for tests"


def _effect(
    name: str,
    amplitude: Parameter,
    drivers: tuple[str, ...],
    balances: tuple[Balance, ...],
    contribution: Callable[[Any, Drivers, Values, Array], Mapping[str, Array]],
    sentence: str,
    memory: EffectMemory | None = None,
) -> Effect:
    return Effect(
        name=name, kind="process", balances=balances, drivers=drivers, parameters=(amplitude,),
        contribution=contribution, signature=sentence, separating_test="", title=sentence, sentence=sentence,
        source=_SOURCE, memory=memory,
    )  # fmt: skip


def _within(value: Array, start: float, end: float) -> Array:
    """Return 1 where start <= value < end, else 0."""
    return 1.0 * (value >= start) * (value < end)


def _door(_xp: Any, drivers: Drivers, values: Values, _memory: Array) -> Mapping[str, Array]:
    working = _within(drivers["hour"], 7.0, 16.0) * (drivers["weekday"] < 5.0)
    return {"air_exchange": values["exchange"] * working + 0.0 * drivers["wind_speed"]}


def _neighbour(_xp: Any, drivers: Drivers, values: Values, _memory: Array) -> Mapping[str, Array]:
    # The neighbour grows a warm crop: 24 degC by day, 21 at night.
    beside = 21.0 + 3.0 * _within(drivers["hour"], 8.0, 20.0)
    return {"heat": values["exchange"] * (beside - drivers["air_temperature"])}


def _fog(xp: Any, drivers: Drivers, values: Values, _memory: Array) -> Mapping[str, Array]:
    dry = xp.minimum(xp.maximum((drivers["vapour_deficit"] - 300.0) / 500.0, 0.0), 1.0)
    vapour = values["rate"] / 3.6e6 * _within(drivers["hour"], 11.0, 14.0) * dry
    return {"vapour": vapour, "heat": -LATENT_HEAT * vapour}


def _whitewash_start(_xp: Any, drivers: Drivers, _values: Values) -> Array:
    return 1.0 + 0.0 * drivers["rain"]


def _whitewash_advance(xp: Any, memory: Array, drivers: Drivers, _values: Values, seconds: float) -> Array:
    # Twenty hours of rain wash off two thirds.
    return memory * xp.exp(-drivers["rain"] * (seconds / 72_000.0))


def _whitewash(_xp: Any, drivers: Drivers, values: Values, memory: Array) -> Mapping[str, Array]:
    return {"light_loss": values["loss"] * memory + 0.0 * drivers["rain"]}


def _flue(xp: Any, drivers: Drivers, values: Values, _memory: Array) -> Mapping[str, Array]:
    cold = xp.minimum(xp.maximum((8.0 - drivers["outdoor_temperature"]) / 8.0, 0.0), 1.0)
    return {"co2": values["rate"] / 3.6e6 * cold * _within(drivers["hour"], 5.0, 9.0)}


def _wet_floor_start(_xp: Any, drivers: Drivers, _values: Values) -> Array:
    return 0.0 * drivers["hour"]


def _wet_floor_advance(xp: Any, memory: Array, drivers: Drivers, _values: Values, seconds: float) -> Array:
    hosing = _within(drivers["hour"], 8.0, 9.0) * (drivers["weekday"] < 1.0)
    dried = memory * xp.exp(-0.0 * drivers["hour"] - seconds / 10_800.0)
    return xp.maximum(dried, 1.0 * hosing)


def _wet_floor(_xp: Any, drivers: Drivers, values: Values, memory: Array) -> Mapping[str, Array]:
    vapour = values["rate"] / 3.6e6 * memory * (drivers["vapour_deficit"] / 600.0)
    return {"vapour": vapour, "heat": -LATENT_HEAT * vapour}


def _buried_main(xp: Any, drivers: Drivers, values: Values, _memory: Array) -> Mapping[str, Array]:
    # Water for the neighbours runs through it, hotter the colder it is, and only at night and in the morning.
    running = 1.0 - _within(drivers["hour"], 11.0, 19.0)
    demand = xp.minimum(xp.maximum((16.0 - drivers["outdoor_temperature"]) / 10.0, 0.0), 1.6)
    return {"heat": values["heat"] * demand * running}


def _compost(xp: Any, drivers: Drivers, values: Values, _memory: Array) -> Mapping[str, Array]:
    # Leaves left between the rows rot: faster when warm and wet.
    warm = xp.exp(0.0693 * (drivers["air_temperature"] - 20.0)) * xp.maximum(drivers["air_humidity"] - 60.0, 0.0) / 20.0
    return {
        "co2": values["rate"] / 3.6e6 * warm,
        "heat": 3.0 * values["rate"] * warm,
        "vapour": 2.0 * values["rate"] / 3.6e6 * warm,
    }


_DEFINITIONS = (
    _effect(
        "open_door",
        Parameter("exchange", "m s-1", 0.0015, 0.0, 0.02, "air that passes the door"),
        ("hour", "weekday", "wind_speed"),
        ("heat", "vapour", "co2"),
        _door,
        "a door stands open in working hours",
    ),
    _effect(
        "warm_neighbour",
        Parameter("exchange", "W m-2 K-1", 1.5, 0.0, 10.0, "heat through the wall for each kelvin"),
        ("hour", "air_temperature"),
        ("heat",),
        _neighbour,
        "the next compartment is warmer and its wall thin",
    ),
    _effect(
        "noon_fogging",
        Parameter("rate", "g m-2 h-1", 60.0, 0.0, 400.0, "water evaporated by the fog nozzles"),
        ("hour", "vapour_deficit"),
        ("vapour", "heat"),
        _fog,
        "fog nozzles run at noon without being logged",
    ),
    _effect(
        "washed_whitewash",
        Parameter("loss", "1", 0.25, 0.0, 0.8, "light lost to fresh whitewash"),
        ("rain",),
        ("light", "heat"),
        _whitewash,
        "whitewash on the cover that rain washes off",
        EffectMemory(_whitewash_start, _whitewash_advance),
    ),
    _effect(
        "boiler_flue",
        Parameter("rate", "g m-2 h-1", 3.0, 0.0, 30.0, "CO2 from a leaking flue"),
        ("hour", "outdoor_temperature"),
        ("co2",),
        _flue,
        "flue gas of the boiler leaks in on cold mornings",
    ),
    _effect(
        "wet_floor",
        Parameter("rate", "g m-2 h-1", 80.0, 0.0, 400.0, "evaporation of the floor just after cleaning"),
        ("hour", "weekday", "vapour_deficit"),
        ("vapour", "heat"),
        _wet_floor,
        "the floor is hosed down on Mondays and dries for hours",
        EffectMemory(_wet_floor_start, _wet_floor_advance),
    ),
    _effect(
        "buried_main",
        Parameter("heat", "W m-2", 10.0, 0.0, 80.0, "heat of the main at 6 degC outdoors"),
        ("hour", "outdoor_temperature"),
        ("heat",),
        _buried_main,
        "a heating main for other greenhouses runs under the floor",
    ),
    _effect(
        "rotting_leaves",
        Parameter("rate", "g m-2 h-1", 0.8, 0.0, 10.0, "CO2 of leaves that rot between the rows"),
        ("air_temperature", "air_humidity"),
        ("co2", "heat", "vapour"),
        _compost,
        "picked leaves rot between the rows",
    ),
)

UNCATALOGUED: Mapping[str, Effect] = MappingProxyType({effect.name: effect for effect in _DEFINITIONS})
"""Every such cause by its name."""
