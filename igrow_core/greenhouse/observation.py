"""What is seen of the plant: by its PLC, by a log, and by the hidden effects."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from igrow.core.air import co2_fraction, humidity_and_deficit, relative_humidity
from igrow.core.arrays import Array
from igrow.core.greenhouse import tomato
from igrow.core.greenhouse.climate_computer import Readings
from igrow.core.greenhouse.parameters import GreenhouseParameters
from igrow.core.greenhouse.state import ACCUMULATED, PlantState
from igrow.core.greenhouse.weather_table import WeatherRow
from igrow.core.quantities import SETPOINTS
from igrow.core.sun import position, solar_day, weekday

SENSOR_CHANNELS = frozenset(
    {"air_temperature", "air_humidity", "air_co2", "rail_pipe_temperature", "grow_pipe_temperature", "par"}
)
"""Channels of sensor effects: measurements that an effect can falsify."""
_SUN_DRIVERS = frozenset({"sun_elevation", "sun_azimuth", "hour", "weekday"})


def readings(xp: Any, state: PlantState, weather: WeatherRow) -> Readings:
    """Return what the PLC's sensors show: the true values with noise and sensor faults."""
    noise, errors, air = state.noise, state.sensor_errors, state.climate.air

    def shown(name: str, value: Array) -> Array:
        return value + noise.get(name, 0.0) + errors.get(name, 0.0)

    return Readings(
        air_temperature=shown("air_temperature", air),
        air_humidity=shown("air_humidity", relative_humidity(xp, air, state.climate.vapour)),
        air_co2=shown("air_co2", co2_fraction(air, state.climate.co2)),
        rail_temperature=shown("rail_pipe_temperature", state.climate.rail),
        grow_temperature=shown("grow_pipe_temperature", state.climate.grow),
        outdoor_temperature=weather.outdoor_temperature,
        global_radiation=weather.global_radiation,
        wind_speed=weather.wind_speed,
    )


def truth(
    xp: Any,
    parameters: GreenhouseParameters,
    state: PlantState,
    weather: WeatherRow,
    setpoints: Mapping[str, Array],
) -> dict[str, Array]:
    """Return every quantity of the registry as it is: states now, actuators as means since the last reset."""
    air = state.climate.air
    values: dict[str, Array] = {
        "outdoor_temperature": weather.outdoor_temperature,
        "outdoor_humidity": weather.outdoor_humidity,
        "outdoor_co2": weather.outdoor_co2,
        "global_radiation": weather.global_radiation,
        "wind_speed": weather.wind_speed,
        "sky_temperature": weather.sky_temperature,
        "wind_direction": wind_direction(weather),
        "rain": weather.rain,
        "air_temperature": air,
        "air_humidity": relative_humidity(xp, air, state.climate.vapour),
        "air_co2": co2_fraction(air, state.climate.co2),
        "par": state.light.par if state.light is not None else 0.0 * air,
        "leaf_area_index": tomato.leaf_area_index(parameters, state.crop),
        "plant_load": tomato.total(state.crop.fruits),
        "net_growth": state.crop.net_growth,
        "fruit_fresh_weight": state.crop.harvested / parameters.fruit_dry_matter,
        **{name: setpoints[name] for name in SETPOINTS if name in setpoints},
        "rail_pipe_temperature": state.climate.rail,
        "grow_pipe_temperature": state.climate.grow,
    }
    for name, value in zip(ACCUMULATED, state.actuators(parameters), strict=True):
        values[name] = state.log[name] / state.log_seconds if state.log_seconds > 0.0 else value
    return values


def wind_direction(weather: WeatherRow) -> Array:
    """Return where the wind comes from, degrees clockwise from north, 0 to 360."""
    direction = np.degrees(np.arctan2(weather.wind_east, weather.wind_north)) % 360.0
    return float(direction) if np.ndim(direction) == 0 else direction


def drivers(
    xp: Any,
    parameters: GreenhouseParameters,
    state: PlantState,
    weather: WeatherRow,
    setpoints: Mapping[str, Array],
    ventilation: Array,
    wanted: frozenset[str],
) -> dict[str, Array]:
    """Return the true drivers of the hidden effects, all of the batch's shape.

    Args:
        xp: the namespace.
        parameters: of the greenhouse.
        state: of the plant.
        weather: now.
        setpoints: as commanded.
        ventilation: through the vents, m s-1.
        wanted: names of drivers that someone reads; the costly ones are left out otherwise.
    """
    like = 0.0 * state.climate.air
    air = state.climate.air
    humidity, deficit = humidity_and_deficit(xp, air, state.climate.vapour)
    light = state.light
    values: dict[str, Array] = {name: like + value for name, value in setpoints.items()}
    values.update(zip(ACCUMULATED, state.actuators(parameters), strict=True))
    values.update(
        outdoor_temperature=like + weather.outdoor_temperature,
        outdoor_humidity=like + weather.outdoor_humidity,
        outdoor_co2=like + weather.outdoor_co2,
        global_radiation=like + weather.global_radiation,
        wind_speed=like + weather.wind_speed,
        sky_temperature=like + weather.sky_temperature,
        rain=like + weather.rain,
        air_temperature=air,
        air_humidity=humidity,
        air_co2=co2_fraction(air, state.climate.co2),
        par=light.par + like if light is not None else like,
        leaf_area_index=tomato.leaf_area_index(parameters, state.crop),
        plant_load=tomato.total(state.crop.fruits),
        rail_pipe_temperature=state.climate.rail,
        grow_pipe_temperature=state.climate.grow,
        mean_height=like + parameters.air_height + parameters.top_height,
        radiation_inside=light.inside + like if light is not None else like,
        vapour_concentration=state.climate.vapour,
        outdoor_vapour_concentration=like + weather.vapour,
        vapour_deficit=deficit,
        ventilation=ventilation,
        transpiration=state.transpiration,
        assimilation=state.assimilation,
        rail_pipe_excess=xp.maximum(state.climate.rail - air, 0.0),
        grow_pipe_excess=xp.maximum(state.climate.grow - air, 0.0),
    )
    if "wind_direction" in wanted:
        values["wind_direction"] = like + wind_direction(weather)
    if wanted & _SUN_DRIVERS:
        elevation, azimuth, hour = position(xp, state.seconds, parameters.latitude, parameters.longitude)
        day = solar_day(np.datetime64(int(state.seconds), "s"), parameters.longitude)
        values.update(
            sun_elevation=like + float(elevation),
            sun_azimuth=like + float(azimuth),
            hour=like + float(hour),
            weekday=like + float(weekday(day)),
        )
    return values
