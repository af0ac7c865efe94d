"""A log that the hybrid stage and the actuation stage made themselves, for tests of what is fitted to logs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.signal import lfilter

from igrow.core import sun
from igrow.core.arrays import Floats, Times
from igrow.core.simulator import actuation
from igrow.core.simulator.closed_loop import closed_run
from igrow.core.simulator.hybrid import record as records
from igrow.core.simulator.hybrid.nominal import nominal, site_record
from igrow.core.site import Site
from igrow.core.telemetry import Telemetry
from tests.made_once import made_once

SITE = Site(name="virtual", latitude=52.0, longitude=4.5)
START = np.datetime64("2020-02-01T00:00:00", "s")
GREENHOUSE = nominal(SITE) | {"condensation_transfer": 0.001, "assimilation_maximum": 7.0}
"""Parameters of the usual virtual greenhouse: damper than its description lets expect, so that its vents are in use."""


def weather(days: int, step: float, seed: int) -> dict[str, Floats]:
    """Weather with days that differ, seeded."""
    generator = np.random.default_rng(seed)
    count = round(days * 86_400 / step)
    time = START + (np.arange(count) * step).astype("timedelta64[s]")
    day = np.arange(count) * step / 86_400.0
    clear = np.interp(day, np.arange(days + 2), generator.uniform(0.2, 0.9, days + 2))
    warm = np.interp(day, np.arange(days + 2), generator.uniform(2.0, 12.0, days + 2))
    wind = np.interp(day, np.arange(0, days + 2, 0.25), generator.uniform(0.5, 9.0, len(np.arange(0, days + 2, 0.25))))
    radiation = 0.7 * clear * sun.extraterrestrial_radiation(time, SITE.latitude, SITE.longitude)
    temperature = warm + 3.0 * np.sin(2.0 * np.pi * (day - 0.375))
    return {
        "outdoor_temperature": temperature,
        "outdoor_humidity": 90.0 - 25.0 * clear,
        "global_radiation": radiation,
        "wind_speed": wind,
        "sky_temperature": temperature - 4.0 - 14.0 * clear,
        "outdoor_co2": np.full(count, 415.0),
    }


def leaf_area(time: Times) -> Floats:
    """Return a leaf area index that is measured, (n,): 2.4 when the logs begin."""
    planted = (time - np.datetime64("2019-12-16", "s")).astype(np.float64) / 86_400.0
    return np.asarray(3.0 / (1.0 + np.exp(-(planted - 35.0) / 9.0)))


def setpoints(days: int, step: float) -> dict[str, Floats]:
    """A day and a night temperature, CO2 and lamps by day."""
    hour = (np.arange(round(days * 86_400 / step)) * step / 3600.0) % 24.0
    day = (hour > 6.0) & (hour < 18.0)
    return {
        "heating_setpoint": np.where(day, 20.0, 17.0),
        "co2_setpoint": np.where(day, 700.0, 400.0),
        "lamp_on": np.where((hour > 4.0) & (hour < 18.0), 1.0, 0.0),
        "irrigation_on": np.where(day, 0.1, 0.0),
    }


def disturbances(days: int, step: float, seed: int, size: float = 1.0) -> dict[str, Floats]:
    """Coloured fluxes that no model knows: correlation time of two hours."""
    generator = np.random.default_rng(seed)
    count = round(days * 86_400 / step)
    keep = float(np.exp(-step / 7200.0))
    sizes = {"heat": 4.0, "vapour": 1e-6, "co2": 6e-8}
    return {
        name: size * usual * np.sqrt(1.0 - keep**2) * lfilter([1.0], [1.0, -keep], generator.standard_normal(count))
        for name, usual in sizes.items()
    }


@made_once
def virtual_log(
    days: int,
    *,
    seed: int = 0,
    step: float = 300.0,
    parameters: Mapping[str, float] | None = None,
    added: Mapping[str, Floats] | None = None,
    noise: bool = True,
    followed: Mapping[str, Floats] | None = None,
    measures_leaves: bool = False,
) -> Telemetry:
    """Return the log of a virtual greenhouse.

    `added` are fluxes that the simulator does not know, (n,); `followed` setpoints that the plant follows in place of
    those that the log has, (n,). Where nobody measures its leaves the crop has the usual course.
    """
    generator = np.random.default_rng(seed + 1)
    outside, asked = weather(days, step, seed), setpoints(days, step)
    count = len(asked["lamp_on"])
    time = START + (np.arange(count) * step).astype("timedelta64[s]")
    empty = {name: np.zeros(count) for name in actuation.OUTPUTS}
    begin = {
        "air_temperature": np.full(count, 18.0),
        "air_humidity": np.full(count, 75.0),
        "air_co2": np.full(count, 450.0),
    }
    leaves = {"leaf_area_index": leaf_area(time)} if measures_leaves else {}
    values = dict(parameters or GREENHOUSE)

    def lived(before: Mapping[str, Floats], rows: int) -> dict[str, Floats]:
        """Return the climate and the actuators of so many rows, floor and soil as `before` would have left them."""
        record = site_record(Telemetry(time[: len(before["air_co2"])], {**before}), SITE, step)
        states = records.observe(record, values, {})
        blank = site_record(Telemetry(time, outside | empty | begin | leaves), SITE, step)
        states = {name: np.broadcast_to(course[:1], count) for name, course in states.items()}
        asks = {**asked, **(followed or {})}
        out = closed_run(blank, states, asks, [0], rows - 1, values, {}, actuation.default_rules(), added)
        climate = {name: np.concatenate([begin[name][:1], out[name][:, 0]]) for name in begin}
        return climate | {name: np.concatenate([out[name][:, 0], out[name][-1:, 0]]) for name in actuation.OUTPUTS}

    columns = outside | asked | leaves
    day = round(86_400.0 / step)
    first = lived(outside | empty | begin | leaves, day)
    known = {name: values[:day] for name, values in (outside | leaves).items()}
    columns = columns | lived(known | first, count)
    if noise:
        for name, size in (("air_temperature", 0.05), ("air_humidity", 0.4), ("air_co2", 5.0)):
            columns[name] = columns[name] + size * generator.standard_normal(count)
    return Telemetry(time, columns)
