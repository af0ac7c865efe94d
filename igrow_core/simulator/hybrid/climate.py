"""The hybrid climate stage: balances of heat, vapour and CO2 of the greenhouse air, with named effects.

The stage is driven by what the actuators did, not by setpoints: the PLC's own control fights every
disturbance, so that a missing effect hides from the temperature and shows in heat, vents and CO2.

Five states per greenhouse: air temperature (degC), vapour (kg m-3), CO2 (kg m-3) and the temperatures of the
floor that follows within a day and of the soil that follows within days (degC); one more for each effect with a memory.
All functions are pure and elementwise over arrays of one shape, and work in numpy and while an ONNX graph is traced
(`xp`). What leaves past the screens stands in `above_screens.py`, what the crop does in `canopy.py`; both make
`balances.py`, which `exponential.py` advances.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from igrow.core import air
from igrow.core.arrays import Array
from igrow.core.effects import EFFECTS
from igrow.core.effects.definition import Drivers, Values
from igrow.core.simulator.hybrid.above_screens import drivers_above, forcing_above
from igrow.core.simulator.hybrid.balances import STATES
from igrow.core.simulator.hybrid.canopy import canopy_drivers, forcing_canopy
from igrow.core.simulator.hybrid.exponential import relax

INPUTS = (
    "outdoor_temperature",
    "outdoor_humidity",
    "outdoor_co2",
    "global_radiation",
    "wind_speed",
    "sky_temperature",
    "rail_pipe_temperature",
    "grow_pipe_temperature",
    "vent_lee",
    "vent_wind",
    "energy_screen",
    "blackout_screen",
    "lamp_power",
    "co2_dosing",
    "leaf_area_index",
)
"""What drives the balances themselves; effects may read more (`igrow.core.effects`)."""

ActiveEffects = Mapping[str, Values]
"""Name of an effect -> values of its parameters. A sensor effect may stand here too: the plant ignores it."""

_PAR_PER_GLOBAL = 2.1
"""Photons of PAR in outdoor radiation, umol J-1 (46 % of the energy, 4.57 umol J-1)."""
_ENERGY_SCREEN_SHADE, _BLACKOUT_SCREEN_SHADE = 0.25, 0.98
"""Light that a closed screen takes (data documentation of the 2019 challenge)."""


def memory_name(effect: str) -> str:
    """Return the name of the state that holds the memory of an effect."""
    return f"memory:{effect}"


@dataclass(frozen=True)
class Forcing:
    """What drives the balances from outside and no state changes: inputs, and what follows from them by the parameters.

    In a run over a log it is computed once, for many steps together.
    """

    drivers: Mapping[str, Array]
    """Inputs and drivers, by name."""
    above: Mapping[str, Array]
    """From `above_screens.forcing_above`."""
    canopy: Mapping[str, Array]
    """From `canopy.forcing_canopy`."""

    def at(self, step: int) -> Forcing:
        """Return that of one step, where arrays have steps as their first axis."""
        parts = (self.drivers, self.above, self.canopy)
        return Forcing(*({name: values[step] for name, values in part.items()} for part in parts))

    @property
    def pipes(self) -> dict[str, Array]:
        """Temperatures of the pipes, degC, from which nothing else here follows."""
        return {name: self.drivers[name] for name in ("rail_pipe_temperature", "grow_pipe_temperature")}

    def with_pipes(self, pipes: Mapping[str, Array]) -> Forcing:
        """Return it with other temperatures of the pipes."""
        return replace(self, drivers={**self.drivers, **pipes})


def forcing(xp: Any, inputs: Drivers, parameters: Values, lamp_efficacy: Array) -> Forcing:
    """Return what of the drivers no state changes; arguments as `derive`'s."""
    radiation = radiation_inside(xp, inputs, parameters)
    sun_par = radiation * _PAR_PER_GLOBAL
    par = sun_par + lamp_efficacy * inputs["lamp_power"]
    # Two closed screens save less than each does of what the other lets pass.
    energy = 1.0 - 0.01 * parameters["energy_screen_saving"] * inputs["energy_screen"]
    blackout = 1.0 - 0.01 * parameters["blackout_screen_saving"] * inputs["blackout_screen"]
    second = parameters["second_screen_share"]
    screens = second * energy * blackout + (1.0 - second) * xp.minimum(energy, blackout)
    outdoor = inputs["outdoor_temperature"]
    surroundings = outdoor + parameters["sky_share"] * (inputs["sky_temperature"] - outdoor)
    drivers = dict(inputs) | {
        "par": par,
        "sun_share_of_par": sun_par / (par + 1e-3),
        "radiation_inside": radiation,
        "outdoor_vapour_concentration": air.vapour_concentration(xp, outdoor, inputs["outdoor_humidity"]),
        "outdoor_co2_concentration": air.co2_concentration(outdoor, inputs["outdoor_co2"]),
        "screens": screens,
        "surroundings": surroundings,
    }
    return Forcing(
        drivers,
        forcing_above(xp, screens, surroundings, inputs, parameters),
        forcing_canopy(xp, drivers, inputs, parameters),
    )


def radiation_inside(xp: Any, inputs: Drivers, parameters: Values) -> Array:
    """Return the short-wave radiation that passes cover and screens, W m-2."""
    shade = (1.0 - 0.01 * _ENERGY_SCREEN_SHADE * inputs["energy_screen"]) * (
        1.0 - 0.01 * _BLACKOUT_SCREEN_SHADE * inputs["blackout_screen"]
    )
    sun = xp.maximum(inputs["global_radiation"], 0.0 * inputs["global_radiation"])
    return parameters["transmissivity"] * shade * sun


def derive(xp: Any, state: Values, inputs: Drivers, parameters: Values, lamp_efficacy: Array) -> dict[str, Array]:
    """Return the drivers: all inputs, the states in the log's quantities, and what effects read beside them.

    Args:
        xp: the array namespace.
        state: `STATES` by name.
        inputs: `INPUTS` and whatever the active effects read, by name; must hold ``mean_height``.
        parameters: `igrow.core.simulator.hybrid.parameters.PARAMETERS` by name.
        lamp_efficacy: photons of PAR per electric energy of the lamps, umol J-1.
    """
    return with_state(xp, state, forcing(xp, inputs, parameters, lamp_efficacy), parameters)


def with_state(xp: Any, state: Values, outer: Forcing, parameters: Values) -> dict[str, Array]:
    """Return the drivers as `derive` does, from those that no state changes."""
    temperature, vapour, co2 = (state[name] for name in STATES[:3])
    zero = 0.0 * temperature
    humidity, deficit = air.humidity_and_deficit(xp, temperature, vapour)
    drivers = {
        **outer.drivers,
        "air_temperature": temperature,
        "air_humidity": humidity,
        "air_co2": air.co2_fraction(temperature, co2),
        "vapour_concentration": vapour,
        "vapour_deficit": deficit,
        "rail_pipe_excess": xp.maximum(outer.drivers["rail_pipe_temperature"] - temperature, zero),
        "grow_pipe_excess": xp.maximum(outer.drivers["grow_pipe_temperature"] - temperature, zero),
    }
    surroundings, screens = drivers["surroundings"], drivers["screens"]
    drivers |= drivers_above(xp, temperature, surroundings, screens, outer.drivers, parameters, outer.above)
    return drivers | canopy_drivers(xp, drivers, parameters, outer.canopy)


def contributions(xp: Any, drivers: Drivers, state: Values, effects: ActiveEffects, seconds: float) -> dict[str, Array]:
    """Return the sum over the active process effects of what they add to each channel they enter, within a step.

    A memory of what actuators do counts as it is in the middle of the step: pulses of irrigation or moves of a vent
    within it are felt within it, and not a step later.
    """
    total: dict[str, Array] = {}
    for name, values in effects.items():
        effect = EFFECTS[name]
        if effect.kind == "process":
            memory = None
            if effect.memory is not None:
                memory = state[memory_name(name)]
                if effect.memory.within_step:
                    memory = effect.memory.advance(xp, memory, drivers, values, 0.5 * seconds)
            for channel, flux in effect.contribution(xp, drivers, values, memory).items():
                total[channel] = total[channel] + flux if channel in total else flux
    return total


def advance(
    xp: Any,
    state: Values,
    inputs: Drivers,
    parameters: Values,
    effects: ActiveEffects,
    *,
    seconds: float,
    lamp_efficacy: Array,
    added: Mapping[str, Array] | None = None,
) -> dict[str, Array]:
    """Return the state `seconds` later, the inputs held.

    Args:
        xp: the array namespace.
        state: `STATES` and the memories of the active effects, by name.
        inputs: see `derive`; pipes are corrected for sensor faults beforehand (`measurement.correct_inputs`).
        parameters: by name.
        effects: the active effects.
        seconds: length of the step; at most 900 s keeps a day within 0.1 K of the limit of small steps.
        lamp_efficacy: umol J-1.
        added: further fluxes by channel (a learned residual model, a disturbance).
    """
    drivers = derive(xp, state, inputs, parameters, lamp_efficacy)
    return step(xp, state, drivers, parameters, effects, seconds=seconds, added=added)


def step(
    xp: Any,
    state: Values,
    drivers: Drivers,
    parameters: Values,
    effects: ActiveEffects,
    *,
    seconds: float,
    added: Mapping[str, Array] | None = None,
) -> dict[str, Array]:
    """Return the state `seconds` later, by the drivers that were derived from it; arguments as `advance`'s."""
    total = contributions(xp, drivers, state, effects, seconds)
    for channel, flux in (added or {}).items():
        total[channel] = total[channel] + flux if channel in total else flux
    following = relax(xp, state, drivers, parameters, total, seconds)
    for name, values in effects.items():
        memory = EFFECTS[name].memory
        if memory is not None:
            key = memory_name(name)
            following[key] = memory.advance(xp, state[key], drivers, values, seconds)
    return following


def initial_state(
    xp: Any, climate: Drivers, inputs: Drivers, parameters: Values, effects: ActiveEffects, lamp_efficacy: Array
) -> dict[str, Array]:
    """Return the state that agrees with measured air temperature (degC), humidity (%) and CO2 (ppm).

    Floor and soil start at ``mass_temperature`` and ``soil_temperature`` where `climate` holds them, else at the air's;
    memories start at rest.
    """
    temperature = climate["air_temperature"]
    state = {
        "air_temperature": temperature,
        "vapour_concentration": air.vapour_concentration(xp, temperature, climate["air_humidity"]),
        "co2_concentration": air.co2_concentration(temperature, climate["air_co2"]),
        "mass_temperature": climate.get("mass_temperature", temperature),
        "soil_temperature": climate.get("soil_temperature", temperature),
    }
    memories = {name: memory for name in effects if (memory := EFFECTS[name].memory) is not None}
    if memories:
        drivers = derive(xp, state, inputs, parameters, lamp_efficacy)
        state |= {memory_name(name): memory.start(xp, drivers, effects[name]) for name, memory in memories.items()}
    return state
