"""Tables of the Autonomous Greenhouse Challenges: Excel days, untidy headers, CSV (gzip or not) or Parquet."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from igrow.core.arrays import Floats, Times
from igrow.core.errors import IgrowError, first_line

_ENDINGS = (".csv.gz", ".csv", ".parquet")
_EPOCH = np.datetime64("1899-12-30T00:00:00", "s")


def find(folder: Path, *stems: str) -> Path | None:
    """Return the first file of a folder whose name is one of `stems` with a known ending, or None."""
    if not folder.is_dir():
        return None
    present = {path.name.lower(): path for path in sorted(folder.iterdir())}
    for stem in stems:
        for ending in _ENDINGS:
            found = present.get(f"{stem}{ending}".lower())
            if found is not None:
                return found
    return None


def read(path: Path) -> Any:
    """Return a file as a data frame of numbers; names lose `%` and spaces, what is no number becomes NaN.

    Raises:
        IgrowError: the file cannot be read as a table.
    """
    import pandas as pd  # noqa: PLC0415  (slow to import)

    try:
        if path.suffix == ".parquet":
            frame = pd.read_parquet(path)
        else:
            with warnings.catch_warnings():
                # A line with a cell more than the header loses it; what the readers use stands before it.
                warnings.simplefilter("ignore", pd.errors.ParserWarning)
                frame = pd.read_csv(path, skipinitialspace=True, index_col=False)
    except (OSError, ValueError, EOFError) as error:
        raise IgrowError(f"{path}: cannot be read as a table: {first_line(error)}") from None
    frame.columns = [str(name).strip().lstrip("%").strip() for name in frame.columns]
    return frame.apply(pd.to_numeric, errors="coerce")


def column(frame: Any, name: str) -> Floats | None:
    """Return a column that is there and not empty, as float64, else None."""
    return columns(frame, {name: name}).get(name)


def columns(frame: Any, names: Mapping[str, str]) -> dict[str, Floats]:
    """Return those columns that are there and not empty, as float64: our names -> the file's, whatever their case."""
    by_name = {str(name).lower(): name for name in frame.columns}
    found = {
        ours: frame[by_name[theirs.lower()]].to_numpy(dtype=np.float64)
        for ours, theirs in names.items()
        if theirs.lower() in by_name
    }
    return {ours: values for ours, values in found.items() if np.isfinite(values).any()}


def excel_times(serial: Floats, path: Path) -> Times:
    """Return Excel days as wall time, datetime64[s], rounded to 5 minutes."""
    if not np.isfinite(serial).all():
        line = int(np.flatnonzero(~np.isfinite(serial))[0]) + 2
        raise IgrowError(f"{path}:{line}: the time is not a number of days since 1899-12-30")
    return _EPOCH + (np.round(serial * 288.0) * 300.0).astype("timedelta64[s]")


def excel_days(serial: Floats) -> Times:
    """Return Excel days as calendar days, datetime64[D]."""
    return np.asarray((_EPOCH + (np.floor(serial + 1e-6) * 86_400.0).astype("timedelta64[s]")).astype("datetime64[D]"))
