"""The climate stage inside a graph: its blocks called in the order of a step, effects and sensor faults with them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from igrow.core.simulator.hybrid.balances import STATES
from igrow.core.simulator.hybrid.climate import memory_name
from igrow.core.simulator.hybrid.measurement import PREDICTED
from igrow.trainer.exporting.blocks import tagged
from igrow.trainer.exporting.climate import ClimateBlocks, EffectBlocks, effect_parameter
from igrow.trainer.exporting.wiring import Wiring

Tensors = Mapping[str, str]
"""Names of tensors (batch,) or (1,) by what they stand for."""


@dataclass(frozen=True)
class ClimateWiring:
    """Where the nodes go, and what holds for a whole graph; each method adds nodes and returns their tensors.

    A state has `blocks.states`; inputs are `blocks.inputs`; drivers are inputs and what `derived` adds to them.
    """

    wiring: Wiring
    blocks: ClimateBlocks
    parameters: Tensors
    """Of each of `blocks.parameters`."""
    day: str
    """Tensor (1,), days since the bundle's reference time, for effects that age."""

    def rest(self, measured: Tensors, inputs: Tensors) -> dict[str, str]:
        """Return the state that agrees with a measured climate (`BEGINNING`), memories at rest."""
        state = self.wiring.call(self.blocks.from_measured, {name: measured[name] for name in PREDICTED})
        state["mass_temperature"] = state["soil_temperature"] = measured["mean_air_temperature"]
        drivers = self.derived(state, inputs)
        for one in self.blocks.effects:
            if one.start:
                # A memory at rest does not depend on the memory; the tensor only fills the block's signature.
                memory = memory_name(one.effect.name)
                tensors = self._effect_tensors(one, drivers, state | {memory: ""})
                state[memory] = self.wiring.call(one.start, tensors)["memory"]
        return state

    def step(self, state: Tensors, inputs: Tensors, seconds: str) -> dict[str, str]:
        """Return the state after a step; `seconds` is a tensor (1,), the length of the step."""
        drivers = self.drivers(state, inputs)
        added, memories = self.effects(drivers, state, seconds)
        tensors = (
            {f"state:{name}": state[name] for name in STATES}
            | tagged("driver", drivers)
            | added
            | dict(self.parameters)
            | {"seconds": seconds}
        )
        return memories | self.wiring.call(self.blocks.relax, tensors)

    def derived(self, state: Tensors, inputs: Tensors) -> dict[str, str]:
        """Return the drivers that follow from a state and its inputs."""
        tensors = (
            {f"state:{name}": state[name] for name in STATES}
            | {f"input:{name}": inputs[name] for name in self.blocks.inputs}
            | dict(self.parameters)
        )
        constants = {"mean_height": self.parameters["mean_height"]}
        return dict(inputs) | constants | self.wiring.call(self.blocks.derive, tensors)

    def drivers(self, state: Tensors, inputs: Tensors) -> dict[str, str]:
        """Return the drivers; where the pipe sensors are known to be off, they are corrected first."""
        drivers = self.derived(state, inputs)
        for one in self.blocks.effects:
            if one.effect.name == "pipe_temperature_offset":
                errors = self.wiring.call(one.contribution, self._effect_tensors(one, drivers, state))
                corrected = {name: self.wiring.add("Sub", [inputs[name], error])[0] for name, error in errors.items()}
                drivers = self.derived(state, dict(inputs) | corrected)
        return drivers

    def effects(self, drivers: Tensors, state: Tensors, seconds: str) -> tuple[dict[str, str], dict[str, str]]:
        """Return what the active effects add, as ``added:channel``, and their memories after a step.

        A memory of what actuators do counts as it is in the middle of the step.
        """
        added: dict[str, list[str]] = {}
        memories: dict[str, str] = {}
        for one in self.blocks.effects:
            tensors = self._effect_tensors(one, drivers, state)
            if one.effect.kind == "process":
                if one.memory and one.effect.memory is not None and one.effect.memory.within_step:
                    (half,) = self.wiring.add("Mul", [seconds, self.wiring.constant("half", [0.5])])
                    tensors |= self.wiring.call(one.memory, tensors | {"seconds": half})
                for channel, tensor in self.wiring.call(one.contribution, tensors).items():
                    added.setdefault(channel, []).append(tensor)
            if one.memory:
                tensors["memory"] = state[memory_name(one.effect.name)]
                following = self.wiring.call(one.memory, tensors | {"seconds": seconds})
                memories[memory_name(one.effect.name)] = following["memory"]
        return {f"added:{channel}": self.wiring.total(parts) for channel, parts in added.items()}, memories

    def measured(self, drivers: Tensors, state: Tensors) -> dict[str, str]:
        """Return what the sensors would show, faults included, by quantity."""
        errors = self.errors(drivers, state)
        return {
            name: self.wiring.total([drivers[name], errors[name]]) if name in errors else drivers[name]
            for name in PREDICTED
        }

    def errors(self, drivers: Tensors, state: Tensors) -> dict[str, str]:
        """Return the errors of the climate sensors known to be off, by quantity."""
        parts: dict[str, list[str]] = {}
        for one in self.blocks.effects:
            if one.effect.kind == "sensor" and set(one.contribution.outputs) <= set(PREDICTED):
                tensors = self._effect_tensors(one, drivers, state)
                for name, error in self.wiring.call(one.contribution, tensors).items():
                    parts.setdefault(name, []).append(error)
        return {name: self.wiring.total(errors) for name, errors in parts.items()}

    def _effect_tensors(self, one: EffectBlocks, drivers: Tensors, state: Tensors) -> dict[str, str]:
        """Return what the blocks of an effect may read."""
        name = one.effect.name
        tensors = {f"driver:{driver}": drivers[driver] for driver in one.effect.drivers if driver in drivers}
        for parameter in one.effect.parameters:
            tensors[parameter.name] = self.parameters[effect_parameter(name, parameter.name)]
        if one.memory:
            tensors["memory"] = state[memory_name(name)]
        if "elapsed_days" in one.effect.drivers:
            (elapsed,) = self.wiring.add("Sub", [self.day, self.parameters[effect_parameter(name, "onset")]])
            (tensors["driver:elapsed_days"],) = self.wiring.add("Relu", [elapsed])
        return tensors
