"""The hybrid climate stage: balances of heat, vapour and CO2 of the greenhouse air, with named effects.

The stage is driven by what the actuators did, not by setpoints: the PLC's own control fights every
disturbance, so that a missing effect hides from the temperature and shows in heat, vents and CO2.

Four states per greenhouse: air temperature (degC), vapour (kg m-3), CO2 (kg m-3) and the temperature of the
floor that follows within a day (degC); one more for each effect with a memory. All functions are pure and
elementwise over arrays of one shape, and work in numpy and while an ONNX graph is traced (`xp`).

The air above the screens holds little, so that it follows at once what is below it and outside: a second zone without
states of its own (Vanthoor 2011, electronic appendix, sections 3 and 8, where it has them). What leaves through vents
and cover leaves from there, and reaches it past the screens; where no screen is drawn, both airs are one.

Over one step each balance C dx/dt = F(x) is advanced by its exponential: x + F/G (1 - exp(-G dt / C)), where G
is the sum of the conductances that pull x back; heat and vapour, which pull at each other through the crop, by that of
both together. It is exact for linear balances with constant inputs, stable for any step (Hochbruck and Ostermann
(2010), Acta Numerica 19, exponential Rosenbrock-Euler).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core import air
from igrow.core.arrays import Array
from igrow.core.effects import EFFECTS
from igrow.core.effects.definition import Drivers, Values

STATES = ("air_temperature", "vapour_concentration", "co2_concentration", "mass_temperature")
"""The states without the memories of effects."""

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

_VOLUMETRIC_HEAT = 1.2 * air.SPECIFIC_HEAT_AIR
"""Heat capacity of air, J m-3 K-1, at 20 degC."""
_PAR_PER_GLOBAL = 2.1
"""Photons of PAR in outdoor radiation, umol J-1 (46 % of the energy, 4.57 umol J-1)."""
_ENERGY_SCREEN_SHADE, _BLACKOUT_SCREEN_SHADE = 0.25, 0.98
"""Light that a closed screen takes (data documentation of the 2019 challenge)."""
_PASCAL_PER_CONTENT = 1.36e5
"""Vapour pressure of a vapour content, Pa per kg m-3, at 20 degC."""
_OPEN_FLOW = 0.2
"""Flow between the air below and above screens that are not drawn, m s-1: so much that both are one."""
_LOW_LEAKS = 0.5
"""Share of the leaks that lies below the screens (Vanthoor 2011, electronic appendix, section 8)."""
_LEAST_CO2 = 1e-6
"""kg m-3, half a part per million: less is a sensor that reads nothing, and must not divide."""
_SLOWEST = 1e-7
"""Rate at which a state is pulled back at least, s-1; in single precision a smaller one would be lost."""
_STOMATA_HALF_OPEN = 6.0
"""Short-wave radiation at which the stomata of a canopy are half open, W m-2 (Stanghellini 1987: 3 for one leaf)."""
_EXTINCTION = 0.7
"""Extinction of radiation in a tomato canopy (Stanghellini 1987)."""


def memory_name(effect: str) -> str:
    """Return the name of the state that holds the memory of an effect."""
    return f"memory:{effect}"


def derive(xp: Any, state: Values, inputs: Drivers, parameters: Values, lamp_efficacy: Array) -> dict[str, Array]:
    """Return the drivers: all inputs, the states in the log's quantities, and what effects read beside them.

    Args:
        xp: the array namespace.
        state: `STATES` by name.
        inputs: `INPUTS` and whatever the active effects read, by name; must hold ``mean_height``.
        parameters: `igrow.core.simulator.hybrid.parameters.PARAMETERS` by name.
        lamp_efficacy: photons of PAR per electric energy of the lamps, umol J-1.
    """
    temperature, vapour, co2 = (state[name] for name in STATES[:3])
    zero = 0.0 * temperature
    shade = (1.0 - 0.01 * _ENERGY_SCREEN_SHADE * inputs["energy_screen"]) * (
        1.0 - 0.01 * _BLACKOUT_SCREEN_SHADE * inputs["blackout_screen"]
    )
    sun = xp.maximum(inputs["global_radiation"], 0.0 * inputs["global_radiation"])
    radiation_inside = parameters["transmissivity"] * shade * sun
    sun_par = radiation_inside * _PAR_PER_GLOBAL
    par = sun_par + lamp_efficacy * inputs["lamp_power"]
    deficit = air.vapour_pressure_deficit(xp, temperature, vapour)
    canopy = 1.0 - xp.exp(-_EXTINCTION * inputs["leaf_area_index"])
    radiation_on_crop = radiation_inside + parameters["lamp_radiation_share"] * inputs["lamp_power"]
    night = parameters["transpiration_night_share"]
    day_share = night + (1.0 - night) * radiation_on_crop / (radiation_on_crop + _STOMATA_HALF_OPEN)
    response = 0.001 * parameters["transpiration_deficit"] * inputs["leaf_area_index"] * day_share
    screens = (1.0 - 0.01 * parameters["energy_screen_saving"] * inputs["energy_screen"]) * (
        1.0 - 0.01 * parameters["blackout_screen_saving"] * inputs["blackout_screen"]
    )
    outdoor = inputs["outdoor_temperature"]
    surroundings = outdoor + parameters["sky_share"] * (inputs["sky_temperature"] - outdoor)
    # A crop that radiates to a cold cover is colder than the air, and evaporates less than the air's deficit says.
    long_wave_loss = parameters["crop_long_wave_loss"] * screens * (temperature - surroundings)
    evaporation = (
        parameters["transpiration_radiation"] * canopy * (radiation_on_crop - long_wave_loss) + response * deficit
    )
    evaporation = xp.maximum(evaporation, zero)
    ppm = air.co2_fraction(temperature, co2)
    assimilation = (
        parameters["assimilation_maximum"]
        / 3.6e6
        * canopy
        * (par / (par + parameters["assimilation_light"]))
        * (ppm / (ppm + parameters["assimilation_co2"]))
    )
    # De Jong (1990): the flow past lee vents saturates with the opening, that past windward vents does not.
    lee = 0.01 * inputs["vent_lee"]
    lee = lee * (1.0 + parameters["vent_curvature"] * (1.0 - lee))
    opening = lee + 0.01 * parameters["vent_windward_ratio"] * inputs["vent_wind"]
    # How warm it is above the screens without vents tells how much rises through these.
    height = inputs["mean_height"]
    cover = parameters["cover_heat_transfer"] + parameters["cover_wind_heat_transfer"] * inputs["wind_speed"]
    still = surroundings + screens * (temperature - surroundings)
    buoyancy = xp.sqrt(xp.abs(still - outdoor) + 0.01)
    ventilation = 0.5 * opening * (parameters["vent_wind"] * inputs["wind_speed"] + parameters["vent_stack"] * buoyancy)
    leakage = (parameters["leakage_still"] + parameters["leakage_wind"] * inputs["wind_speed"]) * height / 3600.0
    exchange_above = ventilation + (1.0 - _LOW_LEAKS) * leakage
    carried = _VOLUMETRIC_HEAT * exchange_above
    unscreened = cover * screens
    top_pull = cover + (1.0 - screens) * carried
    temperature_above = (
        unscreened * temperature + (1.0 - screens) * (cover * surroundings + carried * outdoor)
    ) / top_pull
    closed = 0.01 * xp.maximum(inputs["energy_screen"], inputs["blackout_screen"])
    open_part = 1.0 - closed
    colder = temperature - temperature_above
    # Through closed cloth and its gaps air passes with the two thirds power of the difference (Balemans 1989).
    past_cloth = closed / parameters["screen_air_resistance"] * xp.exp(xp.log(colder * colder + 0.04) / 3.0)
    past_screens = past_cloth + _OPEN_FLOW * open_part * xp.sqrt(xp.maximum(open_part, zero) + 1e-4)
    return dict(inputs) | {
        "air_temperature": temperature,
        "air_humidity": air.relative_humidity(xp, temperature, vapour),
        "air_co2": ppm,
        "par": par,
        "radiation_inside": radiation_inside,
        "vapour_concentration": vapour,
        "outdoor_vapour_concentration": air.vapour_concentration(
            xp, inputs["outdoor_temperature"], inputs["outdoor_humidity"]
        ),
        "vapour_deficit": deficit,
        "ventilation": ventilation,
        "exchange_below": _LOW_LEAKS * leakage,
        "exchange_above": exchange_above,
        "past_screens": past_screens,
        "cover_conductance": cover,
        "temperature_above": temperature_above,
        "share_above": unscreened / top_pull,
        "screens": screens,
        "surroundings": surroundings,
        "transpiration": evaporation / air.LATENT_HEAT,
        "sun_transpiration": parameters["transpiration_radiation"] * canopy * radiation_inside / air.LATENT_HEAT,
        "sun_share_of_par": sun_par / (par + 1e-3),
        "transpiration_response": response * deficit / (deficit + 1.0),
        "long_wave_response": parameters["transpiration_radiation"]
        * canopy
        * parameters["crop_long_wave_loss"]
        * screens,
        "assimilation": assimilation,
        "rail_pipe_excess": xp.maximum(inputs["rail_pipe_temperature"] - temperature, zero),
        "grow_pipe_excess": xp.maximum(inputs["grow_pipe_temperature"] - temperature, zero),
    }


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


def balances(
    xp: Any, state: Values, drivers: Drivers, parameters: Values, added: Mapping[str, Array]
) -> dict[str, tuple[Array, Array, Array]]:
    """Return (net flux, restoring conductance, capacity) of each of `STATES`.

    Heat in W m-2, W m-2 K-1 and J m-2 K-1; vapour and CO2 in kg m-2 s-1, m s-1 and m.

    Args:
        xp: the array namespace.
        state: `STATES` by name.
        drivers: from `derive`.
        parameters: by name.
        added: what effects, a learned residual model or a disturbance add, by channel.
    """
    temperature, vapour, co2, mass = (state[name] for name in STATES)
    height = drivers["mean_height"]
    outdoor = drivers["outdoor_temperature"]
    low, top = _exchange(xp, drivers, added)
    past = drivers["past_screens"]
    light = 1.0 - added.get("light_loss", 0.0)

    # Heat: through the cover and with the air that leaves above the screens, and with that which leaves below.
    temperature_above, cover = drivers["temperature_above"], drivers["cover_conductance"]
    rail = parameters["rail_pipe_heat_transfer"] * drivers["rail_pipe_excess"]
    grow = parameters["grow_pipe_heat_transfer"] * drivers["grow_pipe_excess"]
    sun = drivers["radiation_inside"] * light
    transpiration = drivers["transpiration"] - (1.0 - light) * drivers["sun_transpiration"]
    to_mass = parameters["mass_heat_transfer"] * (temperature - mass)
    heat = (
        rail
        + grow
        + (parameters["lamp_heat_share"] + parameters["lamp_radiation_share"]) * drivers["lamp_power"]
        + parameters["solar_heat_share"] * sun
        - air.LATENT_HEAT * transpiration
        - cover * (temperature_above - drivers["surroundings"])
        - top * _VOLUMETRIC_HEAT * (temperature_above - outdoor)
        - low * _VOLUMETRIC_HEAT * (temperature - outdoor)
        - to_mass
        + added.get("heat", 0.0)
    )
    heat_conductance = (
        (cover + top * _VOLUMETRIC_HEAT) * drivers["share_above"]
        + low * _VOLUMETRIC_HEAT
        + parameters["mass_heat_transfer"]
        + parameters["rail_pipe_heat_transfer"] * xp.tanh(drivers["rail_pipe_excess"])
        + _drying(xp, state, drivers)
    )

    # Vapour: what passes the screens leaves with the air, or condenses on the cover.
    outdoor_vapour = drivers["outdoor_vapour_concentration"]
    dew, wet, _ = _condensation(xp, state, drivers, parameters, top)
    condensation = wet * xp.maximum(dew, 0.0 * dew) * (past + top) / (past + top + wet)
    above = (past * vapour + top * outdoor_vapour - condensation) / (past + top)
    vapour_flux = transpiration - low * (vapour - outdoor_vapour) - past * (vapour - above) + added.get("vapour", 0.0)
    leaves = drivers["transpiration_response"] * (_PASCAL_PER_CONTENT / air.LATENT_HEAT)
    vapour_conductance = low + past * (top + wet) / (past + top + wet) + leaves

    outdoor_co2 = air.co2_concentration(outdoor, drivers["outdoor_co2"])
    respiration = parameters["respiration"] / 3.6e6 * xp.exp(0.0693147 * (temperature - 20.0))
    lit = 1.0 - (1.0 - light) * drivers["sun_share_of_par"]
    assimilation = drivers["assimilation"] * lit + added.get("assimilation", 0.0)
    exchange = low + past * top / (past + top)
    co2_flux = (
        parameters["dosing_share"] * drivers["co2_dosing"] / 3600.0
        - exchange * (co2 - outdoor_co2)
        - assimilation
        + respiration
        + added.get("co2", 0.0)
    )
    co2_conductance = exchange + 0.5 * drivers["assimilation"] / xp.maximum(co2, 0.0 * co2 + _LEAST_CO2)

    mass_flux = to_mass + parameters["mass_solar_share"] * sun
    mass_capacity = 1000.0 * parameters["mass_heat_capacity"]
    air_capacity = parameters["heat_capacity_factor"] * _VOLUMETRIC_HEAT * height
    found = {
        "air_temperature": (heat, heat_conductance, air_capacity),
        "vapour_concentration": (vapour_flux, vapour_conductance, height),
        "co2_concentration": (co2_flux, co2_conductance, height),
        "mass_temperature": (mass_flux, parameters["mass_heat_transfer"], mass_capacity),
    }
    # Without wind, vents, leaks and light nothing pulls CO2 back: its balance is then a plain sum.
    return {
        name: (flux, xp.maximum(conductance, _SLOWEST * capacity), capacity)
        for name, (flux, conductance, capacity) in found.items()
    }


def _exchange(xp: Any, drivers: Drivers, added: Mapping[str, Array]) -> tuple[Array, Array]:
    """Return the exchange with outdoors, m s-1, of the air below the screens and of that above.

    What effects add is below; they may take from the exchange, but not more than there is.
    """
    low = drivers["exchange_below"] + added.get("air_exchange", 0.0)
    zero = 0.0 * low
    return xp.maximum(low, zero), xp.maximum(drivers["exchange_above"] + xp.minimum(low, zero), zero)


def _condensation(xp: Any, state: Values, drivers: Drivers, parameters: Values, top: Array) -> tuple[Array, ...]:
    """Return how much more vapour than the cover bears the air above the screens would hold, kg m-3; the mass transfer
    to the cover, m s-1, where it is wet; and how fast what the cover bears rises with its temperature, kg m-3 K-1."""
    past = drivers["past_screens"]
    above = (past * state["vapour_concentration"] + top * drivers["outdoor_vapour_concentration"]) / (past + top)
    surroundings = drivers["surroundings"]
    cover = surroundings + parameters["cover_share"] * (drivers["temperature_above"] - surroundings)
    saturated = air.saturation_concentration(xp, cover)
    dew = above - saturated
    wet = xp.maximum(dew, 0.0 * dew)
    slope = saturated * (4283.6 / ((cover + 243.04) * (cover + 243.04)) - 1.0 / (cover + 273.15))
    return dew, parameters["condensation_transfer"] * wet / (wet + 1e-5), slope


def _drying(xp: Any, state: Values, drivers: Drivers) -> Array:
    """Return by how much more heat a crop evaporates for each kelvin of warmer, and so drier, air, W m-2 K-1."""
    temperature = state["air_temperature"]
    saturated = state["vapour_concentration"] * _PASCAL_PER_CONTENT + drivers["vapour_deficit"]
    slope = saturated * 4283.6 / ((temperature + 243.04) * (temperature + 243.04))
    more = drivers["transpiration_response"] * slope - drivers["long_wave_response"]
    return xp.maximum(more, 0.0 * more)


def heat_and_vapour(
    xp: Any,
    state: Values,
    drivers: Drivers,
    parameters: Values,
    added: Mapping[str, Array],
    parts: Mapping[str, tuple[Array, Array, Array]],
    seconds: Array,
) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Return by how much a flux of heat and one of vapour change temperature, and vapour, over a step: two rows of two.

    The exponential of both balances together: warmer air is moistened by the crop and by a cover that bears more, and
    moister air is cooled less. Other arguments as `balances`', whose result is `parts`.
    """
    (_, heat_pull, heat_capacity), (_, vapour_pull, vapour_capacity) = (
        parts[name] for name in ("air_temperature", "vapour_concentration")
    )
    past = drivers["past_screens"]
    _, top = _exchange(xp, drivers, added)
    _, wet, slope = _condensation(xp, state, drivers, parameters, top)
    moistened = _drying(xp, state, drivers) / air.LATENT_HEAT + past * wet / (past + top + wet) * slope * (
        parameters["cover_share"] * drivers["share_above"]
    )
    warmed = drivers["transpiration_response"] * _PASCAL_PER_CONTENT
    heat_rate, vapour_rate = seconds / heat_capacity, seconds / vapour_capacity
    own, cross = (-heat_rate * heat_pull, -vapour_rate * vapour_pull), (heat_rate * warmed, vapour_rate * moistened)
    # Both eigenvalues are real, since neither pushes the other away; they are kept apart, and below nought.
    middle, half = 0.5 * (own[0] + own[1]), 0.5 * (own[0] - own[1])
    apart = xp.sqrt(half * half + cross[0] * cross[1] + 1e-6)
    slow, fast = xp.minimum(middle + apart, 0.0 * middle - 1e-4), middle - apart - 1e-3
    first, second = (xp.exp(slow) - 1.0) / slow, (xp.exp(fast) - 1.0) / fast
    linear = (first - second) / (slow - fast)
    constant = first - slow * linear
    return (
        (heat_rate * (constant + linear * own[0]), vapour_rate * linear * cross[0]),
        (heat_rate * linear * cross[1], vapour_rate * (constant + linear * own[1])),
    )


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


def relax(
    xp: Any, state: Values, drivers: Drivers, parameters: Values, added: Mapping[str, Array], seconds: float
) -> dict[str, Array]:
    """Return `STATES` by name `seconds` later, by the exponentials of the balances (see the module's docstring)."""
    parts = balances(xp, state, drivers, parameters, added)
    by_heat, by_vapour = heat_and_vapour(xp, state, drivers, parameters, added, parts, seconds)
    return moved(xp, state, parts, (by_heat, by_vapour), seconds)


def moved(
    xp: Any,
    state: Values,
    parts: Mapping[str, tuple[Array, Array, Array]],
    answers: tuple[tuple[Array, Array], tuple[Array, Array]],
    seconds: Array,
) -> dict[str, Array]:
    """Return `STATES` by name `seconds` later, by fluxes (`balances`) and their answers (`heat_and_vapour`)."""
    pair = ("air_temperature", "vapour_concentration")
    heat, vapour = (parts[name][0] for name in pair)
    following = {name: state[name] + row[0] * heat + row[1] * vapour for name, row in zip(pair, answers, strict=True)}
    for name in STATES[2:]:
        flux, pull, capacity = parts[name]
        following[name] = state[name] + flux / pull * (1.0 - xp.exp(-seconds * pull / capacity))
    return following


def initial_state(
    xp: Any, climate: Drivers, inputs: Drivers, parameters: Values, effects: ActiveEffects, lamp_efficacy: Array
) -> dict[str, Array]:
    """Return the state that agrees with measured air temperature (degC), humidity (%) and CO2 (ppm).

    The floor starts at ``mass_temperature`` where `climate` holds it, else at the air's; memories start at rest.
    """
    temperature = climate["air_temperature"]
    state = {
        "air_temperature": temperature,
        "vapour_concentration": air.vapour_concentration(xp, temperature, climate["air_humidity"]),
        "co2_concentration": air.co2_concentration(temperature, climate["air_co2"]),
        "mass_temperature": climate.get("mass_temperature", temperature),
    }
    drivers = derive(xp, state, inputs, parameters, lamp_efficacy)
    for name, values in effects.items():
        memory = EFFECTS[name].memory
        if memory is not None:
            state[memory_name(name)] = memory.start(xp, drivers, values)
    return state
