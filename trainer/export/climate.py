"""The hybrid climate stage as blocks: `derive`, one block an effect, `relax`; and the wiring of one step.

Tensor names inside a step carry their group: ``state:air_temperature``, ``input:wind_speed``,
``parameter:transmissivity``, ``effect:lamp_heat:share``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from igrow_core import air
from igrow_core.effects import EFFECTS, Effect
from igrow_core.simulator.hybrid import climate
from igrow_core.simulator.hybrid.climate import memory_name
from igrow_core.simulator.hybrid.measurement import PREDICTED
from igrow_core.simulator.hybrid.parameters import PARAMETERS
from trainer.export.blocks import Block, Wiring, grouped, trace

CONSTANTS = ("mean_height", "lamp_efficacy")
"""Site constants that travel with the parameters."""
_EXOGENOUS = ("wind_direction", "rain", "irrigation", "sun_elevation", "sun_azimuth", "hour")
"""Inputs beside `climate.INPUTS` that an effect may read."""


@dataclass(frozen=True)
class EffectBlocks:
    """The blocks of one active effect."""

    effect: Effect
    contribution: Block
    memory: Block | None
    """The memory's next value."""
    start: Block | None
    """The memory at rest."""


@dataclass(frozen=True)
class ClimateBlocks:
    """All blocks of the climate stage with its active effects."""

    inputs: tuple[str, ...]
    """Inputs that the stage or an active effect reads, in the order of the graph's input."""
    states: tuple[str, ...]
    """`climate.STATES` and the memories of the active effects."""
    parameters: tuple[str, ...]
    """Constants, physical parameters, and parameters of the effects as ``effect:name:parameter``; then onsets."""
    channels: tuple[str, ...]
    """What the active effects add, as ``added:channel``."""
    derive: Block
    relax: Block
    from_measured: Block
    """`PREDICTED` to the first three of `climate.STATES`."""
    effects: tuple[EffectBlocks, ...]

    @property
    def blocks(self) -> list[Block]:
        """Every block, for the model's list of functions."""
        found = [self.derive, self.relax, self.from_measured]
        for one in self.effects:
            found += [block for block in (one.contribution, one.memory, one.start) if block]
        return found


def climate_blocks(effects: Sequence[str]) -> ClimateBlocks:
    """Trace the climate stage with these effects active."""
    chosen = [EFFECTS[name] for name in effects]
    read = {driver for effect in chosen for driver in effect.drivers}
    inputs = (*climate.INPUTS, *(name for name in _EXOGENOUS if name in read))
    anything = [*CONSTANTS, *_tag("parameter", PARAMETERS)]
    derive = trace("climate", _derive_formula, [*_tag("state", climate.STATES), *_tag("input", inputs), *anything])
    drivers = (*inputs, *derive.outputs, "mean_height")
    blocks = tuple(_effect_blocks(effect, drivers) for effect in chosen)
    channels = sorted({key for one in blocks if one.effect.kind == "process" for key in one.contribution.outputs})
    relax = trace(
        "balances",
        _relax_formula,
        [
            *_tag("state", climate.STATES),
            *_tag("driver", drivers),
            *_tag("added", channels),
            *_tag("parameter", PARAMETERS),
            "seconds",
        ],
    )
    memories = tuple(memory_name(one.effect.name) for one in blocks if one.memory)
    names = [*CONSTANTS, *_tag("parameter", PARAMETERS)]
    for effect in chosen:
        names += [effect_parameter(effect.name, parameter.name) for parameter in effect.parameters]
        names += [effect_parameter(effect.name, "onset")] if "elapsed_days" in effect.drivers else []
    from_measured = trace("climate_state", _state_formula, PREDICTED)
    return ClimateBlocks(
        inputs,
        (*climate.STATES, *memories),
        tuple(names),
        tuple(_tag("added", channels)),
        derive,
        relax,
        from_measured,
        blocks,
    )


def effect_parameter(effect: str, parameter: str) -> str:
    """Return the name under which a parameter of an effect stands in the graph's parameter input."""
    return f"effect:{effect}:{parameter}"


def wire_step(
    wiring: Wiring,
    blocks: ClimateBlocks,
    state: Mapping[str, str],
    inputs: Mapping[str, str],
    parameters: Mapping[str, str],
    *,
    seconds: str,
    day: str,
) -> tuple[dict[str, str], dict[str, str]]:
    """Wire one step of the stage; returns the tensors of the following state and of this step's drivers.

    Args:
        wiring: takes the nodes.
        blocks: from `climate_blocks`.
        state: tensor of each of `blocks.states`.
        inputs: tensor of each of `blocks.inputs`.
        parameters: tensor of each of `blocks.parameters`.
        seconds: tensor (1,), length of the step.
        day: tensor (1,), days since the bundle's reference time, for effects that age.
    """
    drivers = wire_drivers(wiring, blocks, state, inputs, parameters)
    added, following = wire_effects(wiring, blocks, drivers, state, parameters, seconds=seconds, day=day)
    tensors = (
        {f"state:{name}": state[name] for name in climate.STATES}
        | {f"driver:{name}": tensor for name, tensor in drivers.items()}
        | added
        | dict(parameters)
        | {"seconds": seconds}
    )
    return following | wiring.call(blocks.relax, tensors), drivers


def wire_effects(
    wiring: Wiring,
    blocks: ClimateBlocks,
    drivers: Mapping[str, str],
    state: Mapping[str, str],
    parameters: Mapping[str, str],
    *,
    seconds: str,
    day: str,
) -> tuple[dict[str, str], dict[str, str]]:
    """Wire the active effects; returns what they add, as ``added:channel``, and their following memories."""
    added: dict[str, list[str]] = {}
    following: dict[str, str] = {}
    for one in blocks.effects:
        tensors = _effect_tensors(wiring, one, drivers, state, parameters, day)
        if one.effect.kind == "process":
            for channel, tensor in wiring.call(one.contribution, tensors).items():
                added.setdefault(channel, []).append(tensor)
        if one.memory:
            following[memory_name(one.effect.name)] = wiring.call(one.memory, tensors | {"seconds": seconds})["memory"]
    return {f"added:{channel}": wiring.total(parts) for channel, parts in added.items()}, following


def wire_drivers(
    wiring: Wiring,
    blocks: ClimateBlocks,
    state: Mapping[str, str],
    inputs: Mapping[str, str],
    parameters: Mapping[str, str],
) -> dict[str, str]:
    """Wire the drivers; where the pipe sensors are known to be off, they are corrected first."""
    drivers = wire_derived(wiring, blocks, state, inputs, parameters)
    for one in blocks.effects:
        if one.effect.name == "pipe_temperature_offset":
            errors = wiring.call(one.contribution, _effect_tensors(wiring, one, drivers, state, parameters, ""))
            corrected = {name: wiring.add("Sub", [inputs[name], error])[0] for name, error in errors.items()}
            drivers = wire_derived(wiring, blocks, state, dict(inputs) | corrected, parameters)
    return drivers


def wire_measured(
    wiring: Wiring,
    blocks: ClimateBlocks,
    drivers: Mapping[str, str],
    state: Mapping[str, str],
    parameters: Mapping[str, str],
    day: str,
) -> dict[str, str]:
    """Wire what the sensors would show, faults included, by quantity."""
    errors = wire_errors(wiring, blocks, drivers, state, parameters, day)
    return {
        name: wiring.total([drivers[name], errors[name]]) if name in errors else drivers[name] for name in PREDICTED
    }


def wire_errors(
    wiring: Wiring,
    blocks: ClimateBlocks,
    drivers: Mapping[str, str],
    state: Mapping[str, str],
    parameters: Mapping[str, str],
    day: str,
) -> dict[str, str]:
    """Wire the errors of the climate sensors known to be off, by quantity."""
    parts: dict[str, list[str]] = {}
    for one in blocks.effects:
        if one.effect.kind == "sensor" and set(one.contribution.outputs) <= set(PREDICTED):
            tensors = _effect_tensors(wiring, one, drivers, state, parameters, day)
            for name, error in wiring.call(one.contribution, tensors).items():
                parts.setdefault(name, []).append(error)
    return {name: wiring.total(errors) for name, errors in parts.items()}


def wire_rest(
    wiring: Wiring,
    blocks: ClimateBlocks,
    measured: Mapping[str, str],
    inputs: Mapping[str, str],
    parameters: Mapping[str, str],
    day: str,
) -> dict[str, str]:
    """Wire the state that agrees with a measured climate: floor as warm as the air, memories at rest."""
    state = wiring.call(blocks.from_measured, measured)
    state["mass_temperature"] = state["air_temperature"]
    drivers = wire_derived(wiring, blocks, state, inputs, parameters)
    for one in blocks.effects:
        if one.start:
            # A memory at rest does not depend on the memory; the tensor only fills the block's signature.
            tensors = _effect_tensors(wiring, one, drivers, state | _no_memory(one), parameters, day)
            state[memory_name(one.effect.name)] = wiring.call(one.start, tensors)["memory"]
    return state


def _no_memory(one: EffectBlocks) -> dict[str, str]:
    return {memory_name(one.effect.name): ""}


def wire_derived(
    wiring: Wiring,
    blocks: ClimateBlocks,
    state: Mapping[str, str],
    inputs: Mapping[str, str],
    parameters: Mapping[str, str],
) -> dict[str, str]:
    """Wire the drivers of a state and its inputs."""
    tensors = (
        {f"state:{name}": state[name] for name in climate.STATES}
        | {f"input:{name}": inputs[name] for name in blocks.inputs}
        | dict(parameters)
    )
    return dict(inputs) | {"mean_height": parameters["mean_height"]} | wiring.call(blocks.derive, tensors)


def _effect_tensors(
    wiring: Wiring,
    one: EffectBlocks,
    drivers: Mapping[str, str],
    state: Mapping[str, str],
    parameters: Mapping[str, str],
    day: str,
) -> dict[str, str]:
    name = one.effect.name
    tensors = {f"driver:{driver}": drivers[driver] for driver in one.effect.drivers if driver in drivers}
    tensors |= {
        parameter.name: parameters[effect_parameter(name, parameter.name)] for parameter in one.effect.parameters
    }
    if one.memory:
        tensors["memory"] = state[memory_name(name)]
    if "elapsed_days" in one.effect.drivers:
        (elapsed,) = wiring.add("Sub", [day, parameters[effect_parameter(name, "onset")]])
        (tensors["driver:elapsed_days"],) = wiring.add("Relu", [elapsed])
    return tensors


def _effect_blocks(effect: Effect, drivers: Sequence[str]) -> EffectBlocks:
    known = {*drivers, "elapsed_days"}
    for driver in effect.drivers:
        if driver not in known:
            raise ValueError(f"effect {effect.name} reads {driver}, which the climate stage does not offer")

    def split(arrays: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
        read = {key.removeprefix("driver:"): value for key, value in arrays.items() if key.startswith("driver:")}
        return read, {parameter.name: arrays[parameter.name] for parameter in effect.parameters}

    def contribution(xp: Any, arrays: Mapping[str, Any]) -> Mapping[str, Any]:
        read, values = split(arrays)
        return effect.contribution(xp, read, values, arrays.get("memory"))

    def memory(xp: Any, arrays: Mapping[str, Any]) -> Mapping[str, Any]:
        read, values = split(arrays)
        assert effect.memory is not None
        return {"memory": effect.memory.advance(xp, arrays["memory"], read, values, arrays["seconds"])}

    def start(xp: Any, arrays: Mapping[str, Any]) -> Mapping[str, Any]:
        read, values = split(arrays)
        assert effect.memory is not None
        return {"memory": effect.memory.start(xp, read, values)}

    inputs = [*_tag("driver", effect.drivers), *(parameter.name for parameter in effect.parameters)]
    if effect.memory is None:
        return EffectBlocks(effect, trace(effect.name, contribution, inputs), None, None)
    inputs.append("memory")
    return EffectBlocks(
        effect,
        trace(effect.name, contribution, inputs),
        trace(f"{effect.name}_memory", memory, [*inputs, "seconds"]),
        trace(f"{effect.name}_start", start, inputs),
    )


def _derive_formula(xp: Any, arrays: Mapping[str, Any]) -> Mapping[str, Any]:
    named = grouped(arrays)
    derived = climate.derive(xp, named["state"], named["input"], named["parameter"], arrays["lamp_efficacy"])
    return {name: value for name, value in derived.items() if name not in named["input"]}


def _relax_formula(xp: Any, arrays: Mapping[str, Any]) -> Mapping[str, Any]:
    named = grouped(arrays)
    return climate.relax(
        xp, named["state"], named["driver"], named["parameter"], named.get("added", {}), arrays["seconds"]
    )


def _state_formula(xp: Any, arrays: Mapping[str, Any]) -> Mapping[str, Any]:
    temperature = arrays["air_temperature"]
    return {
        "air_temperature": temperature,
        "vapour_concentration": air.vapour_concentration(xp, temperature, arrays["air_humidity"]),
        "co2_concentration": air.co2_concentration(temperature, arrays["air_co2"]),
    }


def _tag(group: str, names: Sequence[str] | Mapping[str, Any]) -> list[str]:
    return [f"{group}:{name}" for name in names]
