"""The hybrid climate stage as blocks: `derive`, one block an effect, `relax`; `climate_wiring.py` calls them.

What a block reads carries its group: ``state:air_temperature``, ``input:wind_speed``,
``parameter:transmissivity``, ``effect:lamp_heat:share``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from igrow.core import air
from igrow.core.effects import EFFECTS, Effect
from igrow.core.simulator.hybrid import climate
from igrow.core.simulator.hybrid.balances import STATES
from igrow.core.simulator.hybrid.climate import memory_name
from igrow.core.simulator.hybrid.exponential import relax
from igrow.core.simulator.hybrid.measurement import PREDICTED
from igrow.core.simulator.hybrid.parameters import PARAMETERS
from igrow.trainer.exporting.blocks import Block, grouped, tags, trace

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
    """`STATES` and the memories of the active effects."""
    parameters: tuple[str, ...]
    """Constants, physical parameters, and parameters of the effects as ``effect:name:parameter``; then onsets."""
    channels: tuple[str, ...]
    """What the active effects add, as ``added:channel``."""
    derive: Block
    relax: Block
    from_measured: Block
    """`PREDICTED` to the first three of `STATES`."""
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
    anything = [*CONSTANTS, *tags("parameter", PARAMETERS)]
    derive = trace("climate", _derive_formula, [*tags("state", STATES), *tags("input", inputs), *anything])
    drivers = (*inputs, *derive.outputs, "mean_height")
    blocks = tuple(_effect_blocks(effect, drivers) for effect in chosen)
    channels = sorted({key for one in blocks if one.effect.kind == "process" for key in one.contribution.outputs})
    relax = trace(
        "balances",
        _relax_formula,
        [
            *tags("state", STATES),
            *tags("driver", drivers),
            *tags("added", channels),
            *tags("parameter", PARAMETERS),
            "seconds",
        ],
    )
    memories = tuple(memory_name(one.effect.name) for one in blocks if one.memory)
    names = [*CONSTANTS, *tags("parameter", PARAMETERS)]
    for effect in chosen:
        names += [effect_parameter(effect.name, parameter.name) for parameter in effect.parameters]
        names += [effect_parameter(effect.name, "onset")] if "elapsed_days" in effect.drivers else []
    from_measured = trace("climate_state", _state_formula, PREDICTED)
    return ClimateBlocks(
        inputs,
        (*STATES, *memories),
        tuple(names),
        tuple(tags("added", channels)),
        derive,
        relax,
        from_measured,
        blocks,
    )


def effect_parameter(effect: str, parameter: str) -> str:
    """Return the name under which a parameter of an effect stands in the graph's parameter input."""
    return f"effect:{effect}:{parameter}"


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

    inputs = [*tags("driver", effect.drivers), *(parameter.name for parameter in effect.parameters)]
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
    inputs = named["input"] | {"mean_height": arrays["mean_height"]}
    derived = climate.derive(xp, named["state"], inputs, named["parameter"], arrays["lamp_efficacy"])
    return {name: value for name, value in derived.items() if name not in inputs}


def _relax_formula(xp: Any, arrays: Mapping[str, Any]) -> Mapping[str, Any]:
    named = grouped(arrays)
    return relax(xp, named["state"], named["driver"], named["parameter"], named.get("added", {}), arrays["seconds"])


def _state_formula(xp: Any, arrays: Mapping[str, Any]) -> Mapping[str, Any]:
    temperature = arrays["air_temperature"]
    return {
        "air_temperature": temperature,
        "vapour_concentration": air.vapour_concentration(xp, temperature, arrays["air_humidity"]),
        "co2_concentration": air.co2_concentration(temperature, arrays["air_co2"]),
    }
