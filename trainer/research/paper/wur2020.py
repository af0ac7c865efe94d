"""Virtual tomato seasons of Wageningen's simulator, as Cao et al. (2022) published them: one Parquet file.

All seasons share a length and a clock; each is one row of every array. The pre-processing is the paper's:
plant load smoothed, net growth summed, two days masked on which the simulator did not follow the requested settings.
The leaf area, which the paper smooths too, stays as it is here, with the picking of leaves in it; `smooth` is applied
where it is scored.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from igrow.core.arrays import Floats, Integers, Mask, Times
from igrow.core.errors import IgrowError
from igrow.trainer.research.network.leaf_picking import smooth

FAULTY_DAYS = (15, 75)
"""Days of 24 rows, counted from 0, on which the settings that worked differ from the requested ones."""
NEEDED = (
    "global_radiation", "outdoor_temperature", "outdoor_humidity", "wind_speed", "sky_temperature",
    "air_temperature", "air_humidity", "air_co2", "par", "leaf_area_index", "plant_load", "net_growth_rate",
    "fruit_fresh_weight", "heating_setpoint", "co2_setpoint", "lamp_on", "irrigation_on",
    "heating_setpoint_realised", "ventilation_setpoint_realised", "lamp_radiation_limit",
)  # fmt: skip


class TrajectoryFileError(IgrowError):
    """A file of trajectories that cannot be read or lacks something."""


@dataclass(frozen=True)
class Seasons:
    """Seasons of equal length on one clock."""

    names: tuple[str, ...]
    time: Times
    """(hours,) the simulator's own clock."""
    columns: Mapping[str, Floats]
    """Quantity -> (seasons, hours)."""
    valid: Mask
    """(hours,) false on the days that the paper drops."""

    @property
    def hour(self) -> Floats:
        """Hour of the day, (hours,)."""
        since_midnight = self.time - self.time.astype("datetime64[D]")
        return np.asarray(since_midnight.astype("timedelta64[s]").astype(np.float64) / 3600.0)

    def select(self, rows: Sequence[int] | Integers) -> Seasons:
        """Return the seasons at `rows`."""
        index = np.asarray(rows, dtype=np.int64)
        columns = {name: values[index] for name, values in self.columns.items()}
        return Seasons(tuple(self.names[row] for row in index), self.time, columns, self.valid)


def read_seasons(path: Path) -> Seasons:
    """Read a file in the format of trajectories.parquet, or the folder that holds one.

    `net_growth` (kg m-2, cumulative) is made from the rate; `ventilation_offset` (K) is how far the vents' setpoint
    stands above the heating setpoint. Both setpoints move with ramps and sun, their difference does not: it is a
    setting, hour by hour the same in all published seasons, however warm or cold they are.

    Raises TrajectoryFileError where the file is absent, lacks a column, or its seasons differ in length or time.
    """
    file = path / "trajectories.parquet" if path.is_dir() else path
    try:
        table = pd.read_parquet(file)
    except (OSError, ValueError) as error:
        raise TrajectoryFileError(f"{file}: no Parquet file of trajectories ({error})") from error
    missing = [name for name in ("trajectory", "time", *NEEDED) if name not in table.columns]
    if missing:
        raise TrajectoryFileError(f"{file}: lacks the column{'s' * (len(missing) > 1)} {', '.join(missing)}")
    groups = [(str(name), group.sort_values("time")) for name, group in table.groupby("trajectory", sort=True)]
    time = groups[0][1]["time"].to_numpy().astype("datetime64[s]")
    for name, group in groups:
        if not np.array_equal(group["time"].to_numpy().astype("datetime64[s]"), time):
            raise TrajectoryFileError(f"{file}: trajectory {name} has other times than {groups[0][0]}")
    columns = {
        str(name): np.stack([group[name].to_numpy(dtype=np.float64) for _, group in groups])
        for name in table.columns
        if name not in ("trajectory", "time")
    }
    columns["plant_load"] = smooth(columns["plant_load"])
    columns["ventilation_offset"] = columns["ventilation_setpoint_realised"] - columns["heating_setpoint_realised"]
    columns["net_growth"] = np.cumsum(columns["net_growth_rate"], axis=1) * 3600.0
    valid = np.ones(time.size, dtype=bool)
    for day in FAULTY_DAYS:
        valid[day * 24 : (day + 1) * 24] = False
    return Seasons(tuple(name for name, _ in groups), time, columns, valid)
