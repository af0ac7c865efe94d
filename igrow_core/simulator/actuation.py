"""The actuation stage: what a climate computer will do with setpoints, so that plans are made in setpoints.

Parametric rules of Dutch climate computers (Bakker, Bot, Challa and van de Braak (1995), Greenhouse Climate
Control, ch. 4): a pipe temperature from the shortage of heat and the weather, vents on a proportional band above
the heating setpoint with an influence of humidity and a limit by wind, screens by radiation and outdoor
temperature, lamps on request below a radiation limit, CO2 on a proportional band in the light. Some computers take
more setpoints. By one of the humidity the vents open by the larger of what temperature and humidity ask; where it is
not known, damp air starts the vents earlier instead. One of the ventilation has the band begin above itself in place of
the heating setpoint, a minimum pipe bounds the pipe rail below, and the energy screen closes no further than its
own. The rules are fitted to the log of the very greenhouse
(`igrow.trainer.fit.actuation`), so they also stand for settings that no log holds. Pure, elementwise,
traceable: numpy, torch and ONNX graphs run the same code.

Positions follow their targets with a lag, so the stage has a memory: the positions themselves.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from igrow.core.arrays import Array
from igrow.core.effects.definition import Values
from igrow.core.quantities import SETPOINTS, USUAL_SETPOINTS

POSITIONS = (
    "rail_pipe_temperature",
    "grow_pipe_temperature",
    "vent_lee",
    "vent_wind",
    "energy_screen",
    "blackout_screen",
)
"""The memory of the stage: actuators that take time to follow."""
OUTPUTS = (*POSITIONS, "lamp_power", "co2_dosing", "irrigation")
"""What `act` returns."""


@dataclass(frozen=True)
class Rule:
    """One number of the climate computer's settings."""

    name: str
    unit: str
    value: float
    low: float
    high: float
    meaning: str


def _pipe(name: str, base: float, gain: float, weather: float, highest: float, *following: Rule) -> tuple[Rule, ...]:
    return (
        Rule(f"{name}_base", "K", base, -60.0, 60.0, "excess of the pipe over the air at the setpoint, mild weather"),
        Rule(f"{name}_gain", "1", gain, 0.0, 40.0, "more of it for each kelvin below the heating setpoint"),
        Rule(f"{name}_weather", "1", weather, -1.0, 4.0, "more of it for each kelvin that it is colder outside"),
        Rule(f"{name}_wind", "K (m s-1)-1", 0.0, -2.0, 3.0, "more of it for each m/s of wind"),
        Rule(f"{name}_radiation", "K W-1 m2", 0.0, -0.3, 0.1, "change with the radiation outside"),
        Rule(f"{name}_lamps", "K", 0.0, -40.0, 40.0, "change while the lamps burn"),
        Rule(f"{name}_humidity", "K per %", 0.0, 0.0, 4.0, "more of it for each % of humidity above 80"),
        Rule(f"{name}_highest", "K", highest, 5.0, 80.0, "largest excess"),
        Rule(f"{name}_least", "K", 0.0, 0.0, 40.0, "excess that is never left (minimum pipe)"),
        *following,
    )


def _vent(name: str, offset: float, band: float) -> tuple[Rule, ...]:
    return (
        Rule(f"{name}_offset", "K", offset, -5.0, 15.0, "start of opening above the heating setpoint"),
        Rule(f"{name}_day", "K", 0.0, -10.0, 10.0, "change of it by day (from 200 W/m2)"),
        Rule(f"{name}_lamps", "K", 0.0, -10.0, 10.0, "change of it while the lamps burn"),
        Rule(f"{name}_band", "K", band, 0.3, 40.0, "from start to wide open in mild weather"),
        Rule(f"{name}_band_cold", "1", 0.2, 0.0, 3.0, "widening of the band for each kelvin below 20 degC outside"),
        Rule(f"{name}_humidity", "K per %", 0.1, 0.0, 2.0, "earlier start for each % of humidity above 80"),
        Rule(f"{name}_humidity_opening", "1", 0.0, 0.0, 1.0, "largest opening for humidity above its setpoint"),
        Rule(f"{name}_humidity_band", "%", 10.0, 1.0, 40.0, "from the humidity setpoint to that opening"),
        Rule(f"{name}_ventilation", "1", 0.0, 0.0, 1.0, "1: opens above the ventilation setpoint, not the heating's"),
        Rule(f"{name}_screened", "1", 0.3, 0.0, 1.5, "opening under a closed screen over that without"),
        Rule(f"{name}_wind_limit", "1", 0.0, 0.0, 0.2, "share of the opening lost for each m/s of wind above 6"),
        Rule(f"{name}_least", "%", 0.0, 0.0, 20.0, "opening that is never left"),
    )


def _screen(name: str, radiation: float, outdoor: float, *following: Rule) -> tuple[Rule, ...]:
    return (
        Rule(f"{name}_radiation", "W m-2", radiation, -20.0, 400.0, "closes below this radiation"),
        Rule(f"{name}_outdoor", "degC", outdoor, -20.0, 40.0, "closes below this outdoor temperature"),
        Rule(f"{name}_unlit", "%", 90.0, 0.0, 100.0, "closure in the dark, lamps off"),
        Rule(f"{name}_lit", "%", 90.0, 0.0, 100.0, "closure in the dark, lamps on"),
        Rule(f"{name}_open", "%", 0.0, 0.0, 100.0, "closure by day"),
        *following,
    )


_RULES = (
    *_pipe(
        "rail", 10.0, 8.0, 0.8, 50.0, Rule("rail_minimum", "1", 0.0, 0.0, 1.0, "1: keeps the minimum pipe setpoint")
    ),
    *_pipe("grow", 0.0, 4.0, 0.3, 30.0),
    *_vent("lee", 1.0, 6.0),
    *_vent("windward", 3.0, 8.0),
    *_screen(
        *("energy_screen", 60.0, 12.0),
        Rule("energy_screen_limited", "1", 0.0, 0.0, 1.0, "1: closes no further than the energy screen setpoint"),
    ),
    *_screen("blackout_screen", 5.0, 40.0),
    Rule("lamp_capacity", "W m-2", 100.0, 0.0, 500.0, "electric power of the lamps when they all burn"),
    Rule("lamp_radiation", "W m-2", 1500.0, 10.0, 1500.0, "lamps go off above this radiation"),
    Rule("co2_base", "kg m-2 h-1", 0.002, 0.0, 0.05, "dose at the setpoint, in the light"),
    Rule("co2_gain", "kg m-2 h-1 per ppm", 3e-5, 0.0, 1e-3, "more for each ppm below it"),
    Rule("co2_ventilation", "kg m-2 h-1 per %", 0.0, 0.0, 1e-3, "more for each % of vent opening"),
    Rule("co2_light", "kg m-2 h-1 per umol m-2 s-1", 0.0, 0.0, 5e-5, "more for each unit of light on the crop"),
    Rule("co2_capacity", "kg m-2 h-1", 0.015, 0.0, 0.1, "most that is dosed"),
    Rule("irrigation_rate", "L m-2 h-1", 5.0, 0.0, 60.0, "water given while irrigation runs"),
    Rule("pipe_lag", "min", 15.0, 1.0, 120.0, "time in which a pipe follows while heated"),
    Rule("pipe_cooling", "min", 90.0, 5.0, 300.0, "time in which it cools with the circuit off"),
    Rule("vent_lag", "min", 8.0, 1.0, 60.0, "time in which a vent follows"),
    Rule("screen_lag", "min", 12.0, 1.0, 90.0, "time in which a screen follows"),
)

RULES: Mapping[str, Rule] = MappingProxyType({rule.name: rule for rule in _RULES})
"""Every number of the actuation stage by its name."""


VENTS: Mapping[str, str] = MappingProxyType({"vent_lee": "lee", "vent_wind": "windward"})
"""Vents, and what the names of their rules begin with."""
ANSWERS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "humidity_setpoint": tuple(f"{vent}_humidity_opening" for vent in VENTS.values()),
        "ventilation_setpoint": tuple(f"{vent}_ventilation" for vent in VENTS.values()),
        "minimum_pipe_setpoint": ("rail_minimum",),
        "energy_screen_setpoint": ("energy_screen_limited",),
    }
)
"""Setpoints that not every computer takes, and the rules by which one answers to them: 0 where it does not."""
_BANDS = tuple(f"{vent}_humidity_band" for vent in VENTS.values())


def rules_of(setpoint: str) -> tuple[str, ...]:
    """Return the rules that only computers have which take a setpoint; none, where every computer takes it."""
    return ANSWERS.get(setpoint, ()) + (_BANDS if setpoint == "humidity_setpoint" else ())


def setpoints_of(rules: Mapping[str, float]) -> tuple[str, ...]:
    """Return the setpoints that rules answer to, in the registry's order: every computer's, and those of `ANSWERS`."""
    answered = {name for name, own in ANSWERS.items() if any(rules.get(rule, 0.0) > 0.0 for rule in own)}
    return tuple(name for name in SETPOINTS if name in USUAL_SETPOINTS or name in answered)


def rules_for(setpoints: Collection[str]) -> tuple[str, ...]:
    """Return the names of `RULES` that a computer has which takes these setpoints, in their order."""
    others = {rule for name in ANSWERS if name not in setpoints for rule in rules_of(name)}
    return tuple(name for name in RULES if name not in others)


def default_rules() -> dict[str, float]:
    """Return the values of `RULES` by name."""
    return {name: rule.value for name, rule in RULES.items()}


def act(
    xp: Any,
    setpoints: Values,
    weather: Values,
    climate: Values,
    memory: Values,
    parameters: Values,
    *,
    seconds: float,
) -> dict[str, Array]:
    """Return the actuators that the climate computer will have `seconds` later.

    Args:
        xp: the array namespace.
        setpoints: heating_setpoint (degC), co2_setpoint (ppm), lamp_on and irrigation_on (0 to 1), and those of
            `ANSWERS` that are known, in the registry's units.
        weather: outdoor_temperature (degC), global_radiation (W m-2), wind_speed (m s-1).
        climate: air_temperature (degC), air_humidity (%), air_co2 (ppm), par (umol m-2 s-1) as measured now.
        memory: `POSITIONS` now.
        parameters: `RULES` by name.
        seconds: length of the step.

    Returns:
        `OUTPUTS` by name, in the registry's units.
    """
    aims = targets(xp, setpoints, weather, climate, memory, parameters)
    temperature = climate["air_temperature"]
    result: dict[str, Array] = {}
    for name in ("rail_pipe_temperature", "grow_pipe_temperature"):
        # A circuit that is off cools down by itself, much slower than it heats.
        off = xp.where(aims[name] > temperature + 1.0, 0.0 * temperature, 1.0 + 0.0 * temperature)
        minutes = parameters["pipe_lag"] + off * (parameters["pipe_cooling"] - parameters["pipe_lag"])
        result[name] = _follow(xp, memory[name], aims[name], minutes, seconds)
    for name in VENTS:
        result[name] = _follow(xp, memory[name], aims[name], parameters["vent_lag"], seconds)
    for name in ("energy_screen", "blackout_screen"):
        result[name] = _follow(xp, memory[name], aims[name], parameters["screen_lag"], seconds)
    return result | {name: aims[name] for name in ("lamp_power", "co2_dosing", "irrigation")}


def targets(
    xp: Any, setpoints: Values, weather: Values, climate: Values, memory: Values, parameters: Values
) -> dict[str, Array]:
    """Return where each actuator is going, without lags; arguments as `act`'s."""
    p = parameters
    temperature = climate["air_temperature"]
    zero = 0.0 * temperature
    one = 1.0 + zero
    sun = weather["global_radiation"] + zero
    lamp = setpoints["lamp_on"] * xp.where(sun < p["lamp_radiation"], one, zero)
    short = setpoints["heating_setpoint"] - temperature
    moist = xp.maximum(climate["air_humidity"] - 80.0, zero)
    cold = setpoints["heating_setpoint"] - weather["outdoor_temperature"]

    def pipe(name: str) -> Array:
        excess = (
            p[f"{name}_base"]
            + p[f"{name}_gain"] * short
            + p[f"{name}_weather"] * (cold - 12.0)
            + p[f"{name}_wind"] * weather["wind_speed"]
            + p[f"{name}_radiation"] * sun
            + p[f"{name}_lamps"] * lamp
            + p[f"{name}_humidity"] * moist
        )
        wanted = temperature + xp.minimum(xp.maximum(excess, p[f"{name}_least"] + zero), p[f"{name}_highest"] + zero)
        if name == "rail" and "minimum_pipe_setpoint" in setpoints:
            lowest = setpoints["minimum_pipe_setpoint"]
            wanted = xp.maximum(wanted, wanted + p["rail_minimum"] * (lowest - wanted))
        return wanted

    screened = 0.01 * xp.maximum(memory["energy_screen"], memory["blackout_screen"])
    daylight = xp.minimum(sun / 200.0, one)

    def vent(name: str) -> Array:
        start = p[f"{name}_offset"] + p[f"{name}_day"] * daylight + p[f"{name}_lamps"] * lamp
        band = p[f"{name}_band"] * (
            1.0 + p[f"{name}_band_cold"] * xp.maximum(20.0 - weather["outdoor_temperature"], zero)
        )
        above = -short - start + p[f"{name}_humidity"] * moist
        if "ventilation_setpoint" in setpoints:
            later = setpoints["ventilation_setpoint"] - setpoints["heating_setpoint"]
            above = above - p[f"{name}_ventilation"] * later
        share = xp.minimum(xp.maximum(above / band, zero), one)
        if "humidity_setpoint" in setpoints:
            damp = (climate["air_humidity"] - setpoints["humidity_setpoint"]) / p[f"{name}_humidity_band"]
            share = xp.maximum(share, p[f"{name}_humidity_opening"] * xp.minimum(xp.maximum(damp, zero), one))
        share = share * (1.0 + (p[f"{name}_screened"] - 1.0) * screened)
        windy = xp.maximum(1.0 - p[f"{name}_wind_limit"] * xp.maximum(weather["wind_speed"] - 6.0, zero), zero)
        return xp.minimum(xp.maximum(100.0 * share * windy, p[f"{name}_least"] + zero), 100.0 + zero)

    def screen(name: str) -> Array:
        dark = xp.minimum(xp.maximum((p[f"{name}_radiation"] - sun) / 10.0 + 0.5, zero), one)
        cool = xp.minimum(xp.maximum((p[f"{name}_outdoor"] - weather["outdoor_temperature"]) / 2.0 + 0.5, zero), one)
        closed = p[f"{name}_unlit"] + lamp * (p[f"{name}_lit"] - p[f"{name}_unlit"])
        wanted = p[f"{name}_open"] + dark * cool * (closed - p[f"{name}_open"])
        if name == "energy_screen" and "energy_screen_setpoint" in setpoints:
            most = setpoints["energy_screen_setpoint"]
            wanted = xp.minimum(wanted, wanted + p["energy_screen_limited"] * (most - wanted))
        return wanted

    lit = xp.where(sun + 1000.0 * lamp > 10.0, one, zero)
    dose = (
        p["co2_base"]
        + p["co2_gain"] * (setpoints["co2_setpoint"] - climate["air_co2"])
        + p["co2_ventilation"] * (memory["vent_lee"] + memory["vent_wind"])
        + p["co2_light"] * climate["par"]
    )
    return {
        "rail_pipe_temperature": pipe("rail"),
        "grow_pipe_temperature": pipe("grow"),
        **{name: vent(prefix) for name, prefix in VENTS.items()},
        "energy_screen": screen("energy_screen"),
        "blackout_screen": screen("blackout_screen"),
        "lamp_power": p["lamp_capacity"] * lamp,
        "co2_dosing": lit * xp.minimum(xp.maximum(dose, zero), p["co2_capacity"] + zero),
        "irrigation": p["irrigation_rate"] * setpoints["irrigation_on"] + zero,
    }


def _follow(xp: Any, position: Array, target: Array, minutes: Array, seconds: float) -> Array:
    share = 1.0 - xp.exp(-seconds / (60.0 * minutes) + 0.0 * target)
    return position + (target - position) * share
