"""A stretch of time through a batch of greenhouses at one place."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from benchmarks.foreign_greenhouse import climate, crop, light
from benchmarks.foreign_greenhouse.computer import control, positions, recipe
from benchmarks.foreign_greenhouse.plant import ForeignGreenhouse, State, Values, stacked
from igrow.core import sun
from igrow.core.air import co2_fraction, humidity_and_deficit, relative_humidity
from igrow.core.arrays import Floats
from igrow.core.greenhouse import Disturbances, HiddenEffect, Sensors
from igrow.core.greenhouse.disturbances import INTERVAL, combined
from igrow.core.greenhouse.hidden import EffectBank
from igrow.core.greenhouse.observation import SENSOR_CHANNELS, wind_direction
from igrow.core.greenhouse.weather_table import WeatherRow, WeatherTable
from igrow.core.telemetry import Telemetry

TICK = 30.0
"""Seconds of a step; `tests/benchmarks/test_foreign_greenhouse.py` holds longer ones beside shorter."""
TUESDAY, PICKING_HOUR = 1.0, 9.0


def simulate(
    plants: Sequence[ForeignGreenhouse],
    weather: Sequence[Telemetry],
    start: np.datetime64,
    end: np.datetime64,
    states: Sequence[State],
    *,
    seed: int,
    effects: Sequence[Sequence[HiddenEffect]] = (),
    disturbances: Sequence[Disturbances] | None = None,
    tick: float = TICK,
) -> list[tuple[Telemetry, State]]:
    """Run a batch: of every greenhouse the log as its sensors show it, every five minutes, and its state at the end.

    Args:
        plants: the greenhouses.
        weather: of each.
        start: first row, UTC.
        end: last row, UTC.
        states: of each, to begin with.
        seed: of disturbances and noise.
        effects: hidden in each.
        disturbances: of each; usual ones if None.
        tick: longest step, s; it divides five minutes.

    Raises:
        IgrowError: the weather does not cover the time.
    """
    count, rng = len(plants), np.random.default_rng(seed)
    p, table, sensors = stacked(plants), WeatherTable(list(weather)), Sensors()
    latitude, longitude = float(plants[0].latitude), float(plants[0].longitude)
    begin = float(sun.unix_seconds(start))
    bank = EffectBank(np, list(effects), count, begin) if any(len(one) for one in effects) else None
    unknown = combined(disturbances) if disturbances is not None else Disturbances()
    disturbed: list[Any] = [np.zeros(count)] * 3
    s: Values = {name: np.array([one[name] for one in states]) for name in states[0]}
    rows = int((end - start) // np.timedelta64(int(INTERVAL), "s")) + 1
    logs: dict[str, Floats] = {}
    memory: list[Any] = []
    faults: Values = {}
    moved = positions(p, s)
    for row in range(rows):
        now = begin + row * INTERVAL
        elevation, azimuth, hour = (float(one) for one in sun.position(np, now, latitude, longitude))
        weekday = float(sun.weekday(sun.solar_day(np.datetime64(int(now), "s"), longitude)))
        place = {"hour": hour, "sun_elevation": elevation, "sun_azimuth": azimuth, "weekday": weekday}
        setpoints, outside, noise = recipe(hour, elevation), table.at(min(now, table.end)), sensors.draw(rng, count)
        shone = light.distribute(p, s, outside, elevation, 0.0)
        for name, value in (shown(s, outside, setpoints, shone) | moved).items():
            log = logs.setdefault(name, np.full((rows, count), np.nan))
            log[row] = sensors.reading(name, value + faults.get(name, 0.0), noise)
        fresh = unknown.innovate(rng, count)
        disturbed = [unknown.persistence(count) * old + new for old, new in zip(disturbed, fresh, strict=True)]
        if weekday == TUESDAY and PICKING_HOUR <= hour < PICKING_HOUR + INTERVAL / 3600.0:
            s["area"] = np.minimum(s["area"], p.leaf_area_maximum)
        steps = round(INTERVAL / tick)
        moved = dict.fromkeys(moved, 0.0)
        for step in range(steps):
            moment = now + (step + 0.5) * tick
            outside = table.at(min(moment, table.end))
            errors = {name: noise.get(name, 0.0) + faults.get(name, 0.0) for name in SENSOR_CHANNELS}
            control(p, s, outside, setpoints, errors, hour, tick)
            added: Mapping[str, Any] = {}
            if bank is not None:
                added = bank.evaluate(drivers(p, s, outside, setpoints, shone, place), moment, tick, memory)
                faults = {name: added[name] for name in SENSOR_CHANNELS if name in added}
            shone = light.distribute(p, s, outside, elevation, added.get("light_loss", 0.0))
            _advance(p, s, outside, shone, added, disturbed, tick)
            moved = {name: moved[name] + value / steps for name, value in positions(p, s).items()}
    times = start + np.arange(rows) * np.timedelta64(int(INTERVAL), "s")
    return [
        (
            Telemetry(times, {name: values[:, one].copy() for name, values in logs.items()}),
            {name: float(values[one]) for name, values in s.items()},
        )
        for one in range(count)
    ]


def _advance(
    p: ForeignGreenhouse,
    s: Values,
    weather: WeatherRow,
    shone: Values,
    added: Mapping[str, Any],
    disturbed: Sequence[Any],
    seconds: float,
) -> None:
    gases = crop.exchange(p, s, shone, added.get("assimilation", 0.0), seconds)
    vents = climate.vented(p, s, weather)
    air = climate.air(p, s, weather, vents, added.get("air_exchange", 0.0))
    heat, vapour, co2 = (
        one + added.get(name, 0.0) for one, name in zip(disturbed, ("heat", "vapour", "co2"), strict=True)
    )
    climate.advance(p, s, weather, shone, gases, air, (heat, vapour, co2), seconds)
    s["ventilation"], s["transpiration"], s["assimilation"] = vents, gases.transpired, gases.unaffected


def shown(s: Values, weather: WeatherRow, setpoints: Mapping[str, float], shone: Values) -> Values:
    """Return weather, climate and setpoints as exact sensors would show them."""
    like = 0.0 * s["air"]
    return {
        "outdoor_temperature": weather.outdoor_temperature, "outdoor_humidity": weather.outdoor_humidity,
        "global_radiation": weather.global_radiation, "wind_speed": weather.wind_speed,
        "sky_temperature": weather.sky_temperature, "wind_direction": wind_direction(weather), "rain": weather.rain,
        "air_temperature": s["box"],
        "air_humidity": np.minimum(relative_humidity(np, s["air"], s["vapour"]), 100.0),
        "air_co2": co2_fraction(s["air"], s["co2"]), "par": shone["par"], "leaf_area_index": s["area"],
        "rail_pipe_temperature": s["rail"], "grow_pipe_temperature": s["grow"],
        **{name: like + value for name, value in setpoints.items()},
    }  # fmt: skip


def drivers(
    p: ForeignGreenhouse,
    s: Values,
    weather: WeatherRow,
    setpoints: Mapping[str, float],
    shone: Values,
    place: Mapping[str, float],
) -> Values:
    """Return the true drivers of hidden effects."""
    like, air = 0.0 * s["air"], s["air"]
    humidity, deficit = humidity_and_deficit(np, air, s["vapour"])
    values = shown(s, weather, setpoints, shone) | positions(p, s) | {
        "air_temperature": air, "air_humidity": humidity, "vapour_deficit": deficit, "outdoor_co2": weather.outdoor_co2,
        "mean_height": p.air_height + climate.TOP_HEIGHT, "radiation_inside": shone["inside"],
        "vapour_concentration": s["vapour"], "outdoor_vapour_concentration": weather.vapour, "plant_load": 250.0,
        "ventilation": s["ventilation"], "transpiration": s["transpiration"], "assimilation": s["assimilation"],
        "rail_pipe_excess": np.maximum(s["rail"] - air, 0.0), "grow_pipe_excess": np.maximum(s["grow"] - air, 0.0),
        **place,
    }  # fmt: skip
    return {name: like + value for name, value in values.items()}
