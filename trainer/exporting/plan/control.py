"""What the PLC does with setpoints in one step, as blocks: equipment by the fitted rules, heat and CO2 that hold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from igrow.core import air
from igrow.core.simulator import actuation, holding
from igrow.core.simulator.hybrid.balances import STATES, affected_drivers, balances
from igrow.core.simulator.hybrid.exponential import heat_and_vapour, moved
from igrow.core.simulator.hybrid.measurement import PREDICTED
from igrow.core.simulator.hybrid.parameters import PARAMETERS
from igrow.core.simulator.plan import STEPS_PER_HOUR
from igrow.trainer.exporting.blocks import Block, grouped, tags, trace
from igrow.trainer.exporting.climate import ClimateBlocks

CARRIED = ("vent_lee", "vent_wind", "energy_screen", "blackout_screen")
"""Positions of the equipment that an hour hands to the next."""
AFFECTED = ("par", "assimilation")
"""Drivers of growth that effects change."""
SECONDS = 3600.0 / STEPS_PER_HOUR
"""Length of a step."""


def settings(setpoints: Sequence[str]) -> tuple[str, ...]:
    """Return the parameters of the fitted rules of a computer that takes these setpoints."""
    return (*tags("actuation", actuation.rules_for(setpoints)), *tags("holding", holding.PARAMETERS))


def equipment_block(weather: Sequence[str], setpoints: Sequence[str]) -> Block:
    """Trace `_equipment`; `weather` names what is known of it, `setpoints` what the computer takes."""
    return trace(
        "equipment",
        _equipment,
        [
            *tags("setpoint", setpoints),
            *tags("weather", weather),
            *tags("climate", (*PREDICTED, "par")),
            *tags("memory", CARRIED),
            *settings(setpoints),
        ],
    )


def control_block(stage: ClimateBlocks, setpoints: Sequence[str]) -> Block:
    """Trace `_control` for a climate stage with its active effects; `setpoints` are what the computer takes."""
    return trace(
        "control",
        _control,
        [
            *tags("state", STATES),
            *tags("driver", (*stage.inputs, *stage.derive.outputs, "mean_height")),
            *stage.channels,
            *tags("parameter", PARAMETERS),
            *tags("setpoint", setpoints),
            *settings(setpoints),
            "shown_temperature",
            "shown_co2",
        ],
    )


def _equipment(xp: Any, arrays: Mapping[str, Any]) -> Mapping[str, Any]:
    """Lamps, screens, vents and irrigation by the fitted rules; the vents no faster than a step can bear."""
    named = grouped(arrays)
    slow = named["actuation"] | {"vent_lag": xp.maximum(named["actuation"]["vent_lag"], SECONDS / 60.0)}
    climate_now = named["climate"]
    pipes = dict.fromkeys(("rail_pipe_temperature", "grow_pipe_temperature"), 0.0 * climate_now["air_temperature"])
    memory = named["memory"] | pipes
    result = actuation.act(xp, named["setpoint"], named["weather"], climate_now, memory, slow, seconds=SECONDS)
    return {name: result[name] for name in (*CARRIED, "lamp_power", "irrigation")}


def _control(xp: Any, arrays: Mapping[str, Any]) -> Mapping[str, Any]:
    """Heat and CO2 that hold the setpoints, the state at the end of the step, and what effects leave for growth."""
    named = grouped(arrays)
    state, drivers, settings = named["state"], named["driver"], named["holding"]
    parameters, setpoints = named["parameter"], named["setpoint"]
    temperature = state["air_temperature"]
    zero = 0.0 * temperature
    idle = drivers | {"rail_pipe_excess": zero, "grow_pipe_excess": zero, "co2_dosing": zero}
    added = named.get("added", {})
    found = balances(xp, state, idle, parameters, added)
    parts, answers = found.of, heat_and_vapour(xp, idle, found, SECONDS)
    if "minimum_pipe_setpoint" in setpoints:
        excess = xp.maximum(setpoints["minimum_pipe_setpoint"] - arrays["shown_temperature"], zero)
        held = named["actuation"]["rail_minimum"] * parameters["rail_pipe_heat_transfer"] * excess
        settings = settings | {"heating_minimum": xp.maximum(settings["heating_minimum"] + zero, held)}
    # Vapour that comes in meanwhile moves the temperature too.
    to_heat, to_vapour = answers[0]
    flux = parts["air_temperature"][0] + to_vapour / to_heat * parts["vapour_concentration"][0]
    heat = holding.heat_to_hold(xp, setpoints["heating_setpoint"], arrays["shown_temperature"], flux, to_heat, settings)
    wanted = setpoints["co2_setpoint"] + settings["co2_offset"]
    missing = air.co2_concentration(temperature, wanted) - air.co2_concentration(temperature, arrays["shown_co2"])
    vents = 0.005 * (drivers["vent_lee"] + drivers["vent_wind"])
    dose = holding.co2_to_hold(xp, missing, parts["co2_concentration"], vents, settings, SECONDS)
    given = {"air_temperature": heat, "co2_concentration": parameters["dosing_share"] * dose / 3600.0}
    for name, more in given.items():
        flux, pull, capacity = parts[name]
        parts[name] = (flux + more, pull, capacity)
    following = moved(xp, state, parts, answers, SECONDS)
    pipes = parameters["rail_pipe_heat_transfer"] + settings["grow_share"] * parameters["grow_pipe_heat_transfer"]
    affected = {name: one for name, one in affected_drivers(xp, drivers, added).items() if name in AFFECTED}
    return following | affected | {"heat": heat, "co2": dose, "rail_pipe_excess": heat / pipes}
