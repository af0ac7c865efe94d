"""The climate computer, and the grower's setpoints."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from benchmarks.foreign_greenhouse.plant import ForeignGreenhouse, Values
from igrow.core.air import co2_fraction, relative_humidity, saturation_concentration
from igrow.core.greenhouse.weather_table import WeatherRow


def recipe(hour: float, elevation: float) -> dict[str, float]:
    """Return a grower's setpoints at a solar hour: a warm day, a fall at sunset, lamps from midnight on."""
    return {
        "heating_setpoint": 20.0 if 6.0 <= hour < 18.0 else 16.0 if 18.0 <= hour < 22.0 else 17.5,
        "co2_setpoint": 700.0 if elevation > 0.0 or hour < 18.0 else 420.0,
        "lamp_on": 1.0 if hour < 16.0 else 0.0,
        "irrigation_on": 1.0 if 4.0 <= hour < 17.0 else 0.0,
    }


def control(
    p: ForeignGreenhouse,
    s: Values,
    weather: WeatherRow,
    setpoints: Mapping[str, float],
    errors: Mapping[str, Any],
    hour: float,
    seconds: float,
) -> None:
    """Move pipes, vents, screens, lamps, dosing and irrigation.

    Args:
        p: parameters.
        s: states; the actuators' are carried on.
        weather: outside.
        setpoints: of the registry.
        errors: what the sensors add to the truth, by quantity.
        hour: of the solar day.
        seconds: of the step.
    """
    air = s["box"] + errors.get("air_temperature", 0.0)
    humidity = relative_humidity(np, s["air"], s["vapour"]) + errors.get("air_humidity", 0.0)
    ppm = co2_fraction(s["air"], s["co2"]) + errors.get("air_co2", 0.0)
    deficit = 1000.0 * saturation_concentration(np, air) * np.maximum(1.0 - 0.01 * humidity, 0.0)
    wanted, outdoor, radiation = setpoints["heating_setpoint"], weather.outdoor_temperature, weather.global_radiation

    lacking = np.clip(wanted - air, -3.0, 3.0)
    s["integral"] = np.clip(s["integral"] + 5.0 * lacking * seconds / 3600.0, -12.0, 25.0)
    pipe = air + np.clip(1.1 * np.maximum(wanted - outdoor, 0.0) - 4.0 + 10.0 * lacking + s["integral"], 0.0, 50.0)
    if 5.0 <= hour < 8.0:
        pipe = np.maximum(pipe, 36.0)
    rail = np.minimum(pipe, 62.0)
    grow = np.minimum(np.where(rail - air > 18.0, air + 0.7 * (rail - air), air), 48.0)
    for name, asked in (("rail", rail), ("grow", grow)):
        # A valve warms its water faster than that cools.
        pace = np.where(asked > s[name], 420.0, 1500.0)
        s[name] = s[name] + (1.0 - np.exp(-seconds / pace)) * (asked - s[name])

    begin = wanted + 1.2 + 1.8 * np.clip((radiation - 150.0) / 350.0, 0.0, 1.0)
    demand = (air - begin) / np.clip(14.0 - 0.5 * outdoor, 4.0, 16.0)
    demand = np.maximum(demand, 0.18 * np.clip((2.2 - deficit) / 1.2, 0.0, 1.0))
    demand = np.where(outdoor < -2.0, np.minimum(demand, 0.05), demand)
    lee = np.clip(demand, 0.0, np.where(weather.wind_speed > 12.0, 0.3, 1.0))
    windward = np.clip(1.2 * (demand - 0.35), 0.0, np.where(weather.wind_speed > 8.0, 0.1, 1.0))
    for name, target in (("vent_lee", lee), ("vent_wind", windward)):
        # A vent stays where it is until more than a fiftieth of its travel is asked.
        s[name] = s[name] + np.where(np.abs(target - s[name]) > 0.02, _step(target - s[name], seconds, 300.0), 0.0)

    s["lamp"] = (radiation < 280.0 + 60.0 * s["lamp"]) * setpoints["lamp_on"] * (p.lamp_capacity > 0.0)
    closed = s["energy_screen"] > 0.5
    shut = (radiation < 25.0 + 30.0 * closed) & (outdoor < 11.0 + 1.5 * closed)
    crack = 0.06 * np.clip((1.8 - deficit) / 0.8, 0.0, 1.0) + 0.3 * np.clip((air - begin) / 2.0, 0.0, 1.0)
    dark = (radiation < 4.0) & (s["lamp"] > 0.0)
    screens = (("energy_screen", shut * (1.0 - crack), 400.0), ("blackout_screen", dark * (0.97 - crack), 250.0))
    for name, target, travel in screens:
        s[name] = s[name] + _step(target - s[name], seconds, travel)

    low, high = setpoints["co2_setpoint"] - 25.0, setpoints["co2_setpoint"] + 15.0
    permitted = (0.5 * (s["vent_lee"] + s["vent_wind"]) < 0.22) & ((radiation > 10.0) | (s["lamp"] > 0.0))
    s["dosing"] = permitted * np.where(ppm < low, 1.0, np.where(ppm > high, 0.0, s["dosing"]))
    light_sum = s["light_sum"] + seconds * setpoints["irrigation_on"] * (radiation + p.lamp_capacity * s["lamp"] + 12.0)
    begins = light_sum > 1.1e6
    s["light_sum"] = np.where(begins, 0.0, light_sum)
    s["pulse"] = np.maximum(np.where(begins, 240.0, s["pulse"] - seconds), 0.0)


def positions(p: ForeignGreenhouse, s: Values) -> Values:
    """Return the actuators as a log has them, in the units of the registry."""
    screens = {name: 100.0 * s[name] for name in ("vent_lee", "vent_wind", "energy_screen", "blackout_screen")}
    return {
        **screens,
        "lamp_power": p.lamp_capacity * s["lamp"],
        "co2_dosing": p.co2_capacity * s["dosing"],
        "irrigation": 5.0 * (s["pulse"] > 0.0),
    }


def _step(way: Any, seconds: float, travel: float) -> Any:
    return np.clip(way, -seconds / travel, seconds / travel)
