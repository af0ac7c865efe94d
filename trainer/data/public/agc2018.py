"""Reader of the Autonomous Greenhouse Challenge, first edition (cucumber, 2018).

Wageningen University & Research, 4TU.ResearchData, doi:10.4121/uuid:e4987a7b-04dd-4c89-9b18-883aad30ba9a.
Traps: the weather has lost its time of day (its rows match the climate's one to one); no CO2 dosing signal, only
daily sums; pipes read 0 when off; heat is documented in kWh m-2 and is MJ m-2; wall time with daylight saving.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from igrow.core.arrays import Floats, Times
from igrow.core.errors import IgrowError
from igrow.trainer.data.public import challenge, excel_tables
from igrow.trainer.data.source import DailyTable, Source

_CLIMATE = ("Greenhouse_climate", "GreenhouseClimate")
_COLUMNS = challenge.COLUMNS["agc2018"]
_LAMP_POWER = 117.0
"""W m-2: 187 umol m-2 s-1 at 1.6 umol J-1 (data documentation, checked against the daily electricity)."""


def recognises(folder: Path) -> bool:
    """Tell whether a folder is laid out as this challenge's."""
    return challenge.is_set(folder, excel_tables.find(folder, "meteo"), *_CLIMATE)


def read(folder: Path, compartment: str | None = None) -> Source:
    """Return the log of one compartment; raises IgrowError where its files are not as they should be."""
    name = challenge.choose(folder, compartment, *_CLIMATE)
    weather_path = excel_tables.find(folder, "meteo")
    climate_path = excel_tables.find(folder / name, *_CLIMATE)
    if weather_path is None or climate_path is None:
        raise IgrowError(f"{folder}: meteo.csv and {name}/Greenhouse_climate.csv are needed, gzip or not")
    table = excel_tables.read(climate_path)
    outside = excel_tables.read(weather_path)
    if len(outside) != len(table):
        raise IgrowError(
            f"{weather_path}: {len(outside)} rows where {climate_path.name} of {name} has {len(table)}; the weather "
            "has no time of day, so its rows must match the climate's"
        )
    local = excel_tables.excel_times(table["GHtime"].to_numpy(dtype=np.float64), climate_path)
    columns = challenge.climate(table) | challenge.weather(outside)
    # 2000 ppm is where the sensor ends.
    columns["air_co2"] = np.where(columns["air_co2"] > 1999.0, np.nan, columns["air_co2"])
    lamp = excel_tables.column(table, "AssimLight")
    if lamp is not None:
        share = np.clip(0.01 * lamp, 0.0, 1.0)
        columns |= {"lamp_power": _LAMP_POWER * share, "lamp_on": share}
    notes = ["no CO2 dosing signal: only its daily sums are known", *_setpoints(folder / name, local, columns)]
    telemetry = challenge.to_telemetry(local, columns, table)
    used = challenge.daily(excel_tables.find(folder / name, "ResourceCalculations"), _COLUMNS["resources"])
    site = replace(challenge.site("agc2018"), name=f"agc2018-{name.lower().replace('_', '-')}")
    return Source(f"agc2018 {name}", telemetry, _harvests(folder / name), used, site, tuple(notes))


def _setpoints(folder: Path, local: Times, columns: dict[str, Floats]) -> list[str]:
    path = excel_tables.find(folder, "vip")
    if path is None:
        return ["no setpoints are known"]
    table = excel_tables.read(path)
    time = excel_tables.excel_times(table["time"].to_numpy(dtype=np.float64), path)
    columns |= challenge.at_times(local, time, excel_tables.columns(table, _COLUMNS["setpoints"]))
    return []


def _harvests(folder: Path) -> DailyTable | None:
    table = challenge.daily(excel_tables.find(folder, "Production"), _COLUMNS["harvests"])
    if table is None:
        return None
    return DailyTable(table.day, {name: np.diff(values, prepend=0.0) for name, values in table.columns.items()})
