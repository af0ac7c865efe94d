"""What both Autonomous Greenhouse Challenges share: weather, climate, actuators, and the way to telemetry."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from igrow.core.air import STEFAN_BOLTZMANN
from igrow.core.arrays import Floats, Times
from igrow.core.errors import IgrowError
from igrow.core.local_time import from_local
from igrow.core.site import Site, load_site
from igrow.core.telemetry import Telemetry, from_rows
from igrow.trainer.data.public import excel_tables, traps
from igrow.trainer.data.source import DailyTable

TIME_ZONE = "Europe/Amsterdam"
STEP = 300.0
_FOLDER = resources.files("igrow.trainer.data.public")
COLUMNS: Mapping[str, Any] = yaml.safe_load((_FOLDER / "columns.yaml").read_text(encoding="utf-8"))
"""Our names -> the files', by challenge and table."""


def site(name: str) -> Site:
    """Return the site description that comes with the reader of a challenge."""
    with resources.as_file(_FOLDER / "sites" / f"{name}.yaml") as path:
        return load_site(path)


def compartments(folder: Path, *stems: str) -> list[str]:
    """Return the names of the subfolders that hold a climate file."""
    return [child.name for child in sorted(folder.iterdir()) if excel_tables.find(child, *stems) is not None]


def is_set(folder: Path, weather: Path | None, *stems: str) -> bool:
    """Tell whether a folder is a challenge's by its weather and a compartment: many a grower has a weather file too."""
    return weather is not None and bool(compartments(folder, *stems))


def choose(folder: Path, compartment: str | None, *stems: str) -> str:
    """Return the name of the compartment to read; raises IgrowError that names those there are."""
    there = compartments(folder, *stems)
    if compartment is None:
        if len(there) == 1:
            return there[0]
        raise IgrowError(f"{folder}: name a compartment: {', '.join(there)}")
    for name in there:
        if name.lower() == compartment.lower():
            return name
    raise IgrowError(f"{folder}: compartment {compartment} has no climate file; those that have: {', '.join(there)}")


def weather(frame: Any) -> dict[str, Floats]:
    """Return the weather columns of a challenge's weather table by our names."""
    found = excel_tables.columns(frame, COLUMNS["both"]["weather"])
    columns = {ours: traps.without_spikes(ours, values) for ours, values in found.items()}
    net = excel_tables.column(frame, "Pyrgeo")
    if net is not None and "outdoor_temperature" in columns:
        # A pyrgeometer shows the sky's radiation minus its own, which is that of a body at outdoor temperature.
        kelvin = columns["outdoor_temperature"] + 273.15
        columns["sky_temperature"] = np.maximum(net / STEFAN_BOLTZMANN + kelvin**4, 1.0) ** 0.25 - 273.15
    code = excel_tables.column(frame, "Winddir")
    if code is not None:
        # 1, 2, 4 ... 128 are the eight compass points from north on, clockwise (inferred).
        columns["wind_direction"] = np.log2(np.maximum(np.round(code), 1.0)) * 45.0 % 360.0
        columns["wind_direction"][~np.isfinite(code)] = np.nan
    return columns


def climate(frame: Any) -> dict[str, Floats]:
    """Return measured climate and actuators of a challenge's climate table by our names, without lamps and CO2."""
    names = COLUMNS["both"]
    measured = excel_tables.columns(frame, names["climate"])
    for ours, theirs in names["climate"].items():
        if ours not in measured:
            raise IgrowError(f"the climate table has no column {theirs}")
    columns = {ours: traps.without_spikes(ours, values) for ours, values in measured.items()}
    for ours, values in excel_tables.columns(frame, names["positions"]).items():
        columns[ours] = np.clip(values, 0.0, 100.0)
    for ours, values in excel_tables.columns(frame, names["pipes"]).items():
        columns[ours] = traps.cooling_pipe(values, columns["air_temperature"], STEP)
    return columns


def at_times(local: Times, time: Times, columns: Mapping[str, Floats]) -> dict[str, Floats]:
    """Return columns with rows of their own times, as they are at the times `local`; NaN where they have no row."""
    row = np.minimum(np.searchsorted(time, local), len(time) - 1)
    there = time[row] == local
    return {ours: np.where(there, values[row], np.nan) for ours, values in columns.items()}


def to_telemetry(local: Times, columns: Mapping[str, Floats], frame: Any) -> Telemetry:
    """Return telemetry in UTC of rows of a climate table in wall time; rows at times that never were are dropped."""
    time = from_local(local, TIME_ZONE)
    # Rows without any measurement hold computed numbers that mean nothing.
    measured = np.isfinite(frame[["Tair", "VentLee", "EnScr"]].to_numpy(dtype=np.float64)).any(axis=1)
    keep = ~np.isnat(time) & measured
    return from_rows(time[keep], {name: values[keep] for name, values in columns.items()})


def daily(path: Path | None, columns: Mapping[str, str]) -> DailyTable | None:
    """Return a table by day: our names -> the file's; None without a file."""
    if path is None:
        return None
    frame = excel_tables.read(path)
    serial = excel_tables.column(frame, "time")
    if serial is None:
        raise IgrowError(f"{path}: no column time")
    known = np.isfinite(serial)
    found = excel_tables.columns(frame, columns)
    return DailyTable(excel_tables.excel_days(serial[known]), {ours: values[known] for ours, values in found.items()})
