"""Reader of the Autonomous Greenhouse Challenge, second edition (cherry tomato, 2019/2020).

Hemming, de Zwart, Elings, Petropoulou, Righini (2020), 4TU.ResearchData,
doi:10.4121/uuid:88d22c60-21b3-4ea8-90db-20249a5be2a7. Traps: wall time with daylight saving; pipes read 0 when
off; spikes; rows without measurements in which computed columns go on; LED intensities empty while the lamps are
off; the CO2 dose is in kg m-2 h-1, not in the documented unit. The publisher's PAR is a formula of other columns
and is not read.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from igrow.core.arrays import Floats, Times
from igrow.core.errors import IgrowError
from igrow.trainer.data.public import challenge, excel_tables, traps
from igrow.trainer.data.source import DailyTable, Source

_CLIMATE = ("GreenhouseClimate", "Greenhouse_climate")
_COLUMNS = challenge.COLUMNS["agc2019"]
_HPS_POWER = 81.0
_LED_POWER = {"int_blue_vip": 7.27, "int_red_vip": 25.3, "int_farred_vip": 6.23, "int_white_vip": 22.72}
"""W m-2 at full range (data documentation)."""


def recognises(folder: Path) -> bool:
    """Tell whether a folder is laid out as this challenge's."""
    return challenge.is_set(folder, excel_tables.find(folder / "Weather", "Weather"), *_CLIMATE)


def read(folder: Path, compartment: str | None = None) -> Source:
    """Return the log of one compartment; raises IgrowError where its files are not as they should be."""
    name = challenge.choose(folder, compartment, *_CLIMATE)
    weather_path = excel_tables.find(folder / "Weather", "Weather")
    climate_path = excel_tables.find(folder / name, *_CLIMATE)
    if weather_path is None or climate_path is None:
        raise IgrowError(f"{folder}: Weather/Weather.csv and {name}/GreenhouseClimate.csv are needed, gzip or not")
    table = excel_tables.read(climate_path)
    local = excel_tables.excel_times(table["time"].to_numpy(dtype=np.float64), climate_path)
    columns = challenge.climate(table) | _lamps_and_doses(table, local) | _setpoints(table)
    outside = excel_tables.read(weather_path)
    weather_local = excel_tables.excel_times(outside["time"].to_numpy(dtype=np.float64), weather_path)
    columns |= challenge.at_times(local, weather_local, challenge.weather(outside))
    telemetry = challenge.to_telemetry(local, columns, table)
    harvests, notes = _harvests(excel_tables.find(folder / name, "Production"))
    resources = challenge.daily(excel_tables.find(folder / name, "Resources"), _COLUMNS["resources"])
    site = replace(challenge.site("agc2019"), name=f"agc2019-{name.lower()}")
    return Source(f"agc2019 {name}", telemetry, harvests, resources, site, notes)


def _lamps_and_doses(table: Any, local: Times) -> dict[str, Floats]:
    columns: dict[str, Floats] = {}
    hps = excel_tables.column(table, "AssimLight")
    if hps is not None:
        power = _HPS_POWER * 0.01 * hps
        for name, full in _LED_POWER.items():
            intensity = excel_tables.column(table, name)
            if intensity is not None:
                power = power + full * 0.001 * np.nan_to_num(intensity)
        columns["lamp_power"] = power
    dose = excel_tables.column(table, "co2_dos")
    if dose is not None:
        columns["co2_dosing"] = np.clip(dose, 0.0, None)
    given = excel_tables.column(table, "Cum_irr")
    if given is not None:
        columns["irrigation"] = traps.without_spikes("irrigation", _rate(given, local) * 3600.0 / challenge.STEP)
    minutes = excel_tables.column(table, "water_sup")
    if minutes is not None:
        columns["irrigation_on"] = np.clip(_rate(minutes, local) * (60.0 / challenge.STEP), 0.0, 1.0)
    return columns


def _rate(since_midnight: Floats, local: Times) -> Floats:
    """Return what each row adds to a sum that starts anew every midnight."""
    before = np.concatenate([[0.0], since_midnight[:-1]])
    same_day = np.concatenate([[False], local[1:].astype("datetime64[D]") == local[:-1].astype("datetime64[D]")])
    change = np.where(same_day, since_midnight - before, since_midnight)
    return np.maximum(change, 0.0)


def _setpoints(table: Any) -> dict[str, Floats]:
    """Return the realised setpoints, which exist in all rows, unlike the requested ones."""
    columns = excel_tables.columns(table, _COLUMNS["setpoints"])
    lamp = excel_tables.column(table, "assim_vip")
    if lamp is not None:
        columns["lamp_on"] = np.clip(0.01 * lamp, 0.0, 1.0)
    return columns


def _harvests(path: Path | None) -> tuple[DailyTable | None, tuple[str, ...]]:
    table = challenge.daily(path, _COLUMNS["harvests"])
    if table is None:
        return None, ()
    day = np.array(table.day)
    notes: tuple[str, ...] = ()
    if len(day) > 1 and day[0] < day[1] - np.timedelta64(300, "D"):
        # The Reference's first row is one year and one leap day too early: 2019-02-14 stands for 2020-02-14.
        day[0] = day[0] + np.timedelta64(365, "D")
        notes = (f"the first harvest is dated a year too early; read as {day[0]}",)
    order = np.argsort(day, kind="stable")
    return DailyTable(day[order], {name: values[order] for name, values in table.columns.items()}), notes
