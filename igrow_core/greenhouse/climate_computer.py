"""The control that a greenhouse PLC does by itself, from setpoints to actuators.

Heating: a pipe temperature from the difference to the setpoint (proportional and integral) and from the outdoor
temperature, reached by a mixing valve. Ventilation: lee vents before wind vents, by a proportional band above
the ventilation temperature (heating setpoint plus an offset) and by humidity, closed in frost and storm. Energy
screen by heat demand and radiation, with a gap for moisture; blackout screen while lamps burn at night.
Lamps by request below a radiation limit. CO2 by a proportional band, stopped by wide vents. Irrigation pulses by
radiation sum. The rules are those of climate computers as De Zwart (1996, chapter 3) describes them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from igrow.core.arrays import Array
from igrow.core.greenhouse.parameters import GreenhouseParameters
from igrow.core.namespace import clip, ramp

SAFE_SETPOINTS: Mapping[str, float] = {
    "heating_setpoint": 17.0,
    "co2_setpoint": 400.0,
    "lamp_on": 0.0,
    "irrigation_on": 1.0,
}
"""What the PLC holds when nobody commands: a crop survives on it, and it costs little."""


@dataclass(frozen=True)
class ClimateComputer:
    """Settings of the PLC."""

    heating_ramp: float = 6.0
    """Fastest change of the realised heating setpoint, K h-1."""
    pipe_weather: float = 0.9
    """Pipe temperature above air for each kelvin that the setpoint is above outdoors, K K-1."""
    pipe_gain: float = 12.0
    """Pipe temperature for each kelvin that the air lacks, K K-1."""
    pipe_integral: float = 6.0
    """The same for each kelvin and hour, K K-1 h-1."""
    rail_maximum: float = 65.0
    """degC."""
    grow_maximum: float = 50.0
    """degC."""
    grow_share: float = 0.6
    """Excess of the grow pipe over that of the rail, 1."""
    valve_time: float = 400.0
    """Time in which a mixing valve brings its pipe to the asked temperature, s."""
    ventilation_offset: float = 1.0
    """Ventilation begins so far above the heating setpoint, K."""
    ventilation_band: float = 8.0
    """Proportional band of the lee vents at 15 degC outdoors, K; 0.25 K wider for each degree below."""
    wind_vent_delay: float = 0.5
    """Opening of the lee vents, 0 to 1, at which the wind vents begin."""
    ventilation_minimum: float = 0.0
    """Opening that the lee vents never go below, 0 to 1."""
    humidity_start: float = 86.0
    """Relative humidity at which vents open for moisture where no setpoint says it, %."""
    humidity_band: float = 12.0
    """Band over which they open to `humidity_opening`, %."""
    humidity_opening: float = 0.25
    """Largest opening for moisture, 0 to 1."""
    frost_limit: float = 0.0
    """Below this outdoor temperature the vents keep to a tenth, degC."""
    wind_limit: float = 10.0
    """Wind at which the wind vents begin to close, m s-1; 5 more shut them and halve the lee vents."""
    vent_travel: float = 360.0
    """Seconds for the full travel of a vent."""
    screen_travel: float = 240.0
    """Seconds for the full travel of a screen."""
    screen_radiation: float = 40.0
    """Global radiation above which the energy screen opens, W m-2 (20 more or less is its hysteresis)."""
    screen_difference: float = 10.0
    """The energy screen closes where the heating setpoint is so far above outdoors, K (1 K hysteresis)."""
    screen_under_lamps: float = 1.0
    """1: the energy screen may be closed while lamps burn; 0: it may not."""
    screen_moisture_gap: float = 0.04
    """Gap of a closed screen at high humidity, 0 to 1."""
    blackout_radiation: float = 5.0
    """Below this radiation it counts as night for the blackout screen, W m-2."""
    blackout_gap: float = 0.04
    """Gap of the closed blackout screen, 0 to 1; wider when it grows too warm below."""
    lamp_radiation_limit: float = 400.0
    """Global radiation above which lamps are put off, W m-2 (50 hysteresis)."""
    co2_band: float = 60.0
    """Proportional band of CO2 dosing, ppm."""
    co2_vent_stop: float = 0.5
    """Mean vent opening at which dosing has stopped, 0 to 1; it begins to fall at a fifth of it."""
    co2_needs_light: float = 1.0
    """1: CO2 is dosed while sun or lamps shine; 0: in the dark too."""
    pulse_radiation: float = 0.8e6
    """Radiation sum, lamps included, between two irrigation pulses, J m-2."""
    pulse_rest: float = 3.0
    """Longest time between pulses, h."""
    pulse_seconds: float = 180.0
    """Length of a pulse, s."""


class Control(NamedTuple):
    """The memory of the PLC and the positions of its actuators; floats or arrays (N,)."""

    heating_setpoint: Array
    """As ramped, degC."""
    integral: Array
    """Of the control difference, as pipe temperature, K."""
    vent_lee: Array
    """0 to 1, as are the next four."""
    vent_wind: Array
    energy_screen: Array
    blackout_screen: Array
    lamp: Array
    """Fraction of the step that the lamps burn."""
    lamp_allowed: Array
    """1 while radiation is below the lamps' limit."""
    screen_wanted: Array
    """1 while the energy screen is to be closed."""
    rail_heat: Array
    """W m-2 from the boiler, as is the next."""
    grow_heat: Array
    co2_dosing: Array
    """kg m-2 h-1."""
    pulse_sum: Array
    """Share of the way to the next irrigation pulse, 0 to 1."""
    pulse_left: Array
    """Seconds that the present pulse still runs."""
    irrigation: Array
    """L m-2 h-1, mean over the step."""


class Readings(NamedTuple):
    """What the PLC's own sensors say; units of the registry."""

    air_temperature: Array
    air_humidity: Array
    air_co2: Array
    rail_temperature: Array
    grow_temperature: Array
    outdoor_temperature: Array
    global_radiation: Array
    wind_speed: Array


def at_rest(like: Array) -> Control:
    """Return a PLC with everything shut; `like` gives the shape."""
    zero = 0.0 * like
    return Control(
        heating_setpoint=zero + SAFE_SETPOINTS["heating_setpoint"], integral=zero, vent_lee=zero, vent_wind=zero,
        energy_screen=zero, blackout_screen=zero, lamp=zero, lamp_allowed=zero + 1.0, screen_wanted=zero,
        rail_heat=zero, grow_heat=zero, co2_dosing=zero, pulse_sum=zero, pulse_left=zero, irrigation=zero,
    )  # fmt: skip


def control(
    xp: Any,
    settings: ClimateComputer,
    p: GreenhouseParameters,
    before: Control,
    setpoints: Mapping[str, Array],
    seen: Readings,
    seconds: float,
) -> Control:
    """Return what the actuators do for the next `seconds`.

    Args:
        xp: the namespace.
        settings: of the PLC.
        p: parameters of the greenhouse (capacities of its equipment).
        before: the PLC's memory.
        setpoints: in the registry's units; a missing one is `SAFE_SETPOINTS`' value, of humidity `humidity_start`, of
            the ventilation (NaN too) `ventilation_offset` above the heating; pipe and screen bound nothing then. Vents
            never open for heat below the heating setpoint. An opening in % under `vent_lee` or `vent_wind` takes the
            place of the PLC's own demand, within its limits of frost and storm; NaN leaves it to the PLC.
        seen: the readings.
        seconds: until the next call.
    """
    s = settings
    air, humidity, radiation, outdoor = (
        seen.air_temperature,
        seen.air_humidity,
        seen.global_radiation,
        seen.outdoor_temperature,
    )
    wanted = setpoints.get("heating_setpoint", SAFE_SETPOINTS["heating_setpoint"])
    largest = s.heating_ramp * seconds / 3600.0
    setpoint = before.heating_setpoint + clip(xp, wanted - before.heating_setpoint, -largest, largest)

    # Heating
    lack = setpoint - air
    excess = s.pipe_weather * xp.maximum(setpoint - outdoor, 0.0) - 10.0 + s.pipe_gain * lack + before.integral
    integral = before.integral + s.pipe_integral * clip(xp, lack, -1.0, 1.0) * (seconds / 3600.0)
    integral = clip(xp, integral, -20.0, 20.0)
    excess = clip(xp, excess, 0.0, s.rail_maximum)
    minimum = xp.maximum(excess, setpoints.get("minimum_pipe_setpoint", air) - air)
    rail_wanted = xp.minimum(air + minimum, s.rail_maximum)
    grow_wanted = xp.minimum(air + s.grow_share * excess, s.grow_maximum)
    rail_holds = p.rail_exchange * xp.maximum(rail_wanted - air, 0.0)
    grow_holds = p.grow_exchange * xp.maximum(grow_wanted - air, 0.0)
    asks = (excess > 1.0) * 1.0
    rail_heat = (minimum > 1.0) * xp.maximum(
        rail_holds + p.rail_capacity * (rail_wanted - seen.rail_temperature) / s.valve_time, 0.0
    )
    grow_heat = asks * xp.maximum(
        grow_holds + p.grow_capacity * (grow_wanted - seen.grow_temperature) / s.valve_time, 0.0
    )
    available = xp.minimum(p.boiler_capacity / xp.maximum(rail_heat + grow_heat, 1e-9), 1.0)

    # Ventilation
    band = s.ventilation_band + 0.25 * xp.maximum(15.0 - outdoor, 0.0)
    offset: Array = s.ventilation_offset
    if "ventilation_setpoint" in setpoints:
        asked = setpoints["ventilation_setpoint"]
        offset = xp.where(asked >= 0.0, xp.maximum(asked - setpoint, 0.0), s.ventilation_offset)
    by_temperature = clip(xp, (air - setpoint - offset) / band, 0.0, 2.0)
    damp = humidity - setpoints.get("humidity_setpoint", s.humidity_start)
    by_humidity = s.humidity_opening * clip(xp, damp / s.humidity_band, 0.0, 1.0)
    demand = xp.maximum(xp.maximum(by_temperature, by_humidity), s.ventilation_minimum)
    frost = ramp(xp, outdoor, s.frost_limit - 2.0, s.frost_limit)
    storm = ramp(xp, seen.wind_speed, s.wind_limit + 5.0, s.wind_limit)
    largest_lee = (0.1 + 0.9 * frost) * (0.5 + 0.5 * storm)
    lee = _commanded(xp, setpoints.get("vent_lee"), clip(xp, demand, 0.0, 1.0))
    wind = _commanded(xp, setpoints.get("vent_wind"), clip(xp, demand - s.wind_vent_delay, 0.0, 1.0))
    travel = seconds / s.vent_travel
    vent_lee = _move(xp, before.vent_lee, xp.minimum(lee, largest_lee), travel)
    vent_wind = _move(xp, before.vent_wind, xp.minimum(wind, frost * storm), travel)

    # Lamps and screens
    limit = s.lamp_radiation_limit + 50.0 * (before.lamp_allowed - 0.5)
    lamp_allowed = (radiation < limit) * 1.0
    lamp = lamp_allowed * clip(xp, setpoints.get("lamp_on", SAFE_SETPOINTS["lamp_on"]), 0.0, 1.0)
    dark = radiation < s.screen_radiation + 40.0 * (before.screen_wanted - 0.5)
    cold = setpoint - outdoor > s.screen_difference - 2.0 * (before.screen_wanted - 0.5)
    screen_wanted = dark * cold * (1.0 - (1.0 - s.screen_under_lamps) * (lamp > 0.0))
    moisture = s.screen_moisture_gap * ramp(xp, humidity, 82.0, 92.0)
    # Vents that work for temperature need a screen that lets the air through.
    warmth = ramp(xp, air - setpoint, offset + 1.0, offset + 3.0)
    energy = screen_wanted * (1.0 - xp.maximum(moisture, 0.5 * warmth))
    energy = xp.minimum(energy, 0.01 * setpoints.get("energy_screen_setpoint", 100.0))
    blackout = (radiation < s.blackout_radiation) * (lamp > 0.0) * (1.0 - xp.maximum(s.blackout_gap, 0.4 * warmth))
    travel = seconds / s.screen_travel
    energy_screen = _move(xp, before.energy_screen, energy, travel)
    blackout_screen = _move(xp, before.blackout_screen, blackout, travel)

    # Carbon dioxide
    missing = setpoints.get("co2_setpoint", SAFE_SETPOINTS["co2_setpoint"]) - seen.air_co2
    opening = 0.5 * (vent_lee + vent_wind)
    light = clip(xp, (radiation - 5.0) / 15.0, 0.0, 1.0)
    lit = xp.maximum(xp.maximum(light, (lamp > 0.0) * 1.0), 1.0 - s.co2_needs_light)
    dosing = (
        p.co2_capacity
        * clip(xp, missing / s.co2_band, 0.0, 1.0)
        * ramp(xp, opening, s.co2_vent_stop, 0.2 * s.co2_vent_stop)
        * lit
    )

    # Irrigation
    permitted = clip(xp, setpoints.get("irrigation_on", SAFE_SETPOINTS["irrigation_on"]), 0.0, 1.0)
    inside = radiation + lamp * p.lamp_capacity
    pulse_sum = before.pulse_sum + permitted * seconds * (
        inside / s.pulse_radiation + (permitted > 0.0) / (3600.0 * s.pulse_rest)
    )
    begins = pulse_sum >= 1.0
    pulse_left = before.pulse_left + xp.where(begins, s.pulse_seconds, 0.0)
    running = xp.minimum(pulse_left, seconds)

    return Control(
        heating_setpoint=setpoint,
        integral=integral,
        vent_lee=vent_lee,
        vent_wind=vent_wind,
        energy_screen=energy_screen,
        blackout_screen=blackout_screen,
        lamp=lamp,
        lamp_allowed=lamp_allowed,
        screen_wanted=screen_wanted,
        rail_heat=rail_heat * available,
        grow_heat=grow_heat * available,
        co2_dosing=dosing,
        pulse_sum=xp.where(begins, 0.0, pulse_sum),
        pulse_left=pulse_left - running,
        irrigation=p.irrigation_rate * running / seconds,
    )


def _commanded(xp: Any, command: Array | None, own: Array) -> Array:
    """Return the opening that somebody else commands, 0 to 1, where one is given."""
    return own if command is None else xp.where(command >= 0.0, 0.01 * command, own)


def _move(xp: Any, position: Array, target: Array, travel: float) -> Array:
    """Return the position after a drive has moved towards the target by at most `travel`."""
    return position + clip(xp, target - position, -travel, travel)
