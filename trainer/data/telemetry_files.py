"""Reader of telemetry: single files, folders of day segments, the exchange, and growers' own exports."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from igrow.core import telemetry as core
from igrow.core.errors import IgrowError
from igrow.core.quantities import QUANTITIES
from igrow.core.telemetry import Telemetry
from igrow.trainer.data import mapping
from igrow.trainer.data.source import Source

_ENDINGS = (".csv", ".csv.gz", ".parquet")
MAPPING_FILE = "mapping.yaml"


def read(paths: Sequence[Path], translation: Path | None = None) -> Source:
    """Return the log of files and folders, joined in time; where rows overlap the later-named file counts.

    Args:
        paths: of files, or of folders with files.
        translation: mapping of all of them; None: `mapping.yaml` in a file's folder, or `NAME.mapping.yaml` beside
            the file NAME.csv, where there is one.

    Raises:
        IgrowError: a file breaks the format, or a folder holds no telemetry.
    """
    tables: list[Telemetry] = []
    for path in paths:
        for part in _files(path):
            found = translation or mapping_beside(part, path)
            tables.append(read_file(part) if found is None else mapping.read(part, mapping.load(found)))
    if not tables:
        raise IgrowError("no telemetry files were given")
    return Source(paths[0].name, tables[0] if len(tables) == 1 else core.concatenate(tables))


def mapping_beside(file: Path, given: Path) -> Path | None:
    """Return the mapping of a file: its own, the one in its folder, or the one in the folder that was given."""
    own = [file.with_name(f"{stem}.{MAPPING_FILE}") for stem in (file.name, file.name.split(".")[0])]
    shared = [file.with_name(MAPPING_FILE), given / MAPPING_FILE]
    return next((path for path in (*own, *shared) if path.is_file()), None)


def read_file(path: Path) -> Telemetry:
    """Return one telemetry file, CSV (gzip or not) or Parquet."""
    return read_parquet(path) if path.suffix == ".parquet" else core.read_csv(path)


def read_parquet(path: Path) -> Telemetry:
    """Return a Parquet file with a `time` column (UTC, or with a time zone) and columns of the registry.

    Raises:
        IgrowError: it cannot be read, has no time, or has a column that is no quantity.
    """
    try:
        frame = pd.read_parquet(path)
    except (OSError, ValueError) as error:
        raise IgrowError(f"{path}: cannot be read as Parquet: {str(error).splitlines()[0]}") from None
    if "time" not in frame.columns:
        raise IgrowError(f"{path}: no column time; one with UTC times is needed")
    unknown = [name for name in frame.columns if name != "time" and name not in QUANTITIES]
    if unknown:
        raise IgrowError(f"{path}: column {unknown[0]} is no known quantity; a {MAPPING_FILE} can name what it is")
    times = pd.to_datetime(frame["time"], utc=True, errors="coerce")
    if times.isna().any():
        raise IgrowError(f"{path}: row {int(np.flatnonzero(times.isna())[0]) + 1} has no readable time")
    seconds = times.dt.tz_localize(None).to_numpy(dtype="datetime64[s]")
    columns = {
        name: pd.to_numeric(frame[name], errors="coerce").to_numpy(dtype=np.float64)
        for name in frame.columns
        if name != "time"
    }
    return core.from_rows(seconds, columns)


def _files(path: Path) -> list[Path]:
    if path.is_file():
        return [path]
    found = [part for part in sorted(path.rglob("*")) if part.is_file() and part.name.lower().endswith(_ENDINGS)]
    if not found:
        raise IgrowError(f"{path}: no telemetry in it: CSV, CSV.gz or Parquet files are needed")
    return found
