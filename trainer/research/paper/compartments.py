"""Daily records of the compartments of both Autonomous Greenhouse Challenges: what the crop got and what it gave.

Of five of the six compartments of the second challenge no climate is published; what is known of all of them each
day is the sun, the lamps' electricity, the temperature of the slab and what hands did. Cumulative harvests follow.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from igrow.core import gaps
from igrow.core.arrays import Floats, Integers, Times
from igrow.core.errors import IgrowError
from igrow.trainer.data.public import agc2018, challenge, excel_tables
from igrow.trainer.data.public.challenge import daily

LAMP_EFFICACY_2019 = 100.0 / 81.0
"""umol per J: 100 umol m-2 s-1 from HPS lamps of 81 W m-2; the LEDs give 97 from 62 W m-2."""
LAMP_EFFICACY_2018 = 1.6
TRANSMISSION = 0.5
"""Share of outdoor light above the crop, before screens: the publisher's own formula for this glasshouse."""


@dataclass(frozen=True)
class Compartment:
    """One crop in one compartment, by days of the calendar."""

    name: str
    day: Times
    """(days,) datetime64[D], without gaps."""
    drivers: Mapping[str, Floats]
    """(days,): light_sum (mol m-2 d-1 above the crop), temperature (degC), stem_density (m-2, 1 where unknown)."""
    harvest_day: Integers
    """(harvests,) rows of `day`."""
    harvested: Floats
    """(harvests,) cumulative kg m-2, classes A and B, after each harvest."""
    resources: Mapping[str, Floats]
    """(days,): heat (MJ m-2), electricity_peak, electricity_off_peak (kWh m-2), co2 (kg m-2), where known."""
    brix: Floats
    """(harvests,) degree Brix between its samples, NaN where unknown."""
    plant_density: float
    """Plants m-2, NaN where unknown."""

    def cumulative(self) -> Floats:
        """Return kg m-2 harvested by the end of each day, (days,)."""
        result = np.zeros(self.day.size)
        before = np.concatenate([[0.0], self.harvested[:-1]])
        np.add.at(result, self.harvest_day, self.harvested - before)
        return np.cumsum(result)


def _held(day: Times, known_day: Times, values: Floats) -> Floats:
    """Return weekly values on each day: the last known one, before the first known the first."""
    good = np.isfinite(values)
    row = np.searchsorted(known_day[good], day, side="right") - 1
    return np.asarray(values[good][np.maximum(row, 0)])


def _by_day(time: Times, values: Floats, day: Times) -> Floats:
    """Return the mean of the finite values of each local day, gaps filled between days."""
    row = (time.astype("datetime64[D]") - day[0]).astype(np.int64)
    good = np.isfinite(values) & (row >= 0) & (row < day.size)
    count = np.bincount(row[good], minlength=day.size)
    if not good.any():
        raise IgrowError("a driver of the harvest has no value on any day")
    total = np.bincount(row[good], weights=values[good], minlength=day.size)
    return gaps.interpolated(np.where(count > 0, total / np.maximum(count, 1), np.nan))


def read_2019(folder: Path) -> list[Compartment]:
    """Return the compartments of the second challenge (cherry tomato), sorted by name."""
    weather = excel_tables.find(folder / "Weather", "Weather")
    if weather is None:
        raise IgrowError(f"{folder}: Weather/Weather.csv is needed, gzip or not")
    outside = excel_tables.read(weather)
    time = excel_tables.excel_times(outside["time"].to_numpy(dtype=np.float64), weather)
    compartments, columns = [], challenge.COLUMNS["agc2019"]
    for name in challenge.compartments(folder, "Production"):
        resources = daily(excel_tables.find(folder / name, "Resources"), columns["resources"])
        crop = daily(excel_tables.find(folder / name, "CropParameters"), columns["crop"])
        quality = daily(excel_tables.find(folder / name, "TomQuality"), columns["quality"])
        harvest = daily(excel_tables.find(folder / name, "Production"), columns["harvests"])
        slab = excel_tables.find(folder / name, "GrodanSens")
        if resources is None or crop is None or quality is None or harvest is None or slab is None:
            raise IgrowError(f"{folder / name}: Resources, CropParameters, TomQuality, Production, GrodanSens needed")
        day = np.arange(resources.day[0], resources.day[-1] + 1)
        books = {key: _at_days(resources.day, values, day) for key, values in resources.columns.items()}
        sun = _by_day(time, outside["PARout"].to_numpy(dtype=np.float64), day) * 86_400e-6 * TRANSMISSION
        lamps = (books["electricity_peak"] + books["electricity_off_peak"]) * 3.6 * LAMP_EFFICACY_2019
        table = excel_tables.read(slab)
        slab_time = excel_tables.excel_times(table["time"].to_numpy(dtype=np.float64), slab)
        temperature = table[["t_slab1", "t_slab2"]].mean(axis=1).to_numpy(dtype=np.float64)
        harvest_days = np.array(harvest.day)
        # The Reference's first harvest is dated a year and a day too early (see the reader of this challenge).
        harvest_days[harvest_days < day[0]] += np.timedelta64(365, "D")
        order = np.argsort(harvest_days)
        harvest_days = harvest_days[order]
        class_a, class_b = (np.nan_to_num(harvest[key])[order] for key in ("class_a", "class_b"))
        quality_day = (quality.day - day[0]).astype(np.float64)
        good = np.isfinite(quality["brix"])
        rows = (harvest_days - day[0]).astype(np.int64)
        compartments.append(
            Compartment(
                name=name, day=day,
                drivers={
                    "light_sum": sun + lamps,
                    "temperature": _by_day(slab_time, temperature, day),
                    "stem_density": _held(day, crop.day, crop["stem_density"]),
                },
                harvest_day=rows, harvested=np.cumsum(class_a + class_b), resources=books,
                brix=np.interp(rows, quality_day[good], quality["brix"][good]),
                plant_density=float(np.nanmedian(crop["plant_density"])),
            )
        )  # fmt: skip
    return compartments


def read_2018(folder: Path) -> list[Compartment]:
    """Return the compartments of the first challenge (cucumber), sorted by name."""
    compartments = []
    for name in challenge.compartments(folder, "Production"):
        log = agc2018.read(folder, name)
        if log.harvests is None or log.resources is None:
            raise IgrowError(f"{folder / name}: Production and ResourceCalculations are needed")
        telemetry = log.telemetry
        day = np.arange(telemetry.time[0].astype("datetime64[D]"), telemetry.time[-1].astype("datetime64[D]"))
        # PAR is 2.1 umol per J of global radiation.
        sun = _by_day(telemetry.time, telemetry["global_radiation"], day) * 2.1 * 86_400e-6 * TRANSMISSION
        lamps = _by_day(telemetry.time, telemetry["lamp_power"], day) * 86_400e-6 * LAMP_EFFICACY_2018
        rows = (log.harvests.day - day[0]).astype(np.int64)
        total = np.nan_to_num(log.harvests["class_a"]) + np.nan_to_num(log.harvests["class_b"])
        keep = (rows >= 0) & (rows < day.size) & (total > 0)
        compartments.append(
            Compartment(
                name=name, day=day,
                drivers={
                    "light_sum": sun + lamps,
                    "temperature": _by_day(telemetry.time, telemetry["air_temperature"], day),
                    "stem_density": np.ones(day.size),
                },
                harvest_day=rows[keep], harvested=np.cumsum(total)[keep],
                resources={}, brix=np.full(int(keep.sum()), np.nan), plant_density=float("nan"),
            )
        )  # fmt: skip
    return compartments


def _at_days(known: Times, values: Floats, day: Times) -> Floats:
    result = np.zeros(day.size)
    rows = (known - day[0]).astype(np.int64)
    keep = (rows >= 0) & (rows < day.size) & np.isfinite(values)
    result[rows[keep]] = values[keep]
    return result
