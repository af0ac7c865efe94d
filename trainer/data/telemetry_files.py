"""Reader of telemetry: single files, folders of day segments, the exchange, and growers' own exports."""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from igrow.core import telemetry as core
from igrow.core.errors import IgrowError
from igrow.core.quantities import QUANTITIES
from igrow.core.yaml_schema import load
from igrow.trainer.data import export
from igrow.trainer.data.cells import ENDINGS, EXCEL, is_archive, may_be_table, read_frame
from igrow.trainer.data.mapping import ExportMapping
from igrow.trainer.data.rows import Merged, joined, merge
from igrow.trainer.data.source import Source

MAPPING_FILE = "mapping.yaml"


def read(paths: Sequence[Path], translation: Path | None = None) -> Source:
    """Return the log of files and folders, joined in time; where rows overlap the later-named file counts.

    Args:
        paths: of files, or of folders with files.
        translation: mapping of all of them; None: `NAME.mapping.yaml` beside the file NAME.csv, else `mapping.yaml` in
            its folder (for files that are not telemetry already).

    Raises:
        IgrowError: a file breaks the format, or a folder holds no telemetry.
    """
    paths = [unpacked(path) for path in paths]
    tables = [read_file(part, translation or mapping_beside(part, path)) for path in paths for part in files_in(path)]
    if not tables:
        raise IgrowError("no telemetry files were given")
    whole = joined(tables)
    return Source(paths[0].name, whole.telemetry, notes=whole.notes, faults=whole.faults)


def unpacked(path: Path) -> Path:
    """Return the folder of an archive that was unpacked beside it, any other path as it is; raises IgrowError."""
    if not is_archive(path):
        return path
    folder = path.with_suffix("")
    if not folder.is_dir():
        raise IgrowError(f"{path}: is a zip archive that is not unpacked yet")
    return folder


def read_file(path: Path, translation: Path | None = None) -> Merged:
    """Return one file: an export by its mapping, or telemetry in CSV (gzip or not) or Parquet; raises IgrowError."""
    if translation is not None:
        return export.read(path, load(translation, ExportMapping))
    if path.name.lower().endswith(EXCEL):
        raise IgrowError(f"{path}: a workbook needs a mapping")
    return read_parquet(path) if path.suffix.lower() == ".parquet" else merge(*core.read_rows(path))


def mapping_beside(file: Path, given: Path) -> Path | None:
    """Return the mapping of a file: its own, else for an export the one in its folder or in the folder given."""
    own = own_mapping(file)
    if own.is_file():
        return own
    shared = next((path for path in (file.with_name(MAPPING_FILE), given / MAPPING_FILE) if path.is_file()), None)
    return shared if shared is not None and not _is_telemetry(file) else None


def own_mapping(file: Path) -> Path:
    """Return where the mapping of one file stands: `export.mapping.yaml` for `export.csv`."""
    name = file.name
    ending = next((one for one in sorted(ENDINGS, key=len, reverse=True) if name.lower().endswith(one)), "")
    return file.with_name(f"{name[: len(name) - len(ending)] if ending else name}.{MAPPING_FILE}")


def read_parquet(path: Path) -> Merged:
    """Return a Parquet file with a `time` column (UTC, or with a time zone) and columns of the registry.

    Raises:
        IgrowError: it cannot be read, has no time, or has a column that is no quantity.
    """
    import pandas as pd  # noqa: PLC0415  (slow to import)

    frame = read_frame(path)
    if "time" not in frame.columns and isinstance(frame.index, pd.DatetimeIndex):
        frame = frame.reset_index(names="time")
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
    return merge(seconds, columns)


def files_in(path: Path) -> list[Path]:
    """Return the tables of a folder, or the file itself; raises IgrowError where there is none."""
    if path.is_file():
        return [path]
    if not path.exists():
        raise IgrowError(f"{path}: there is no such file or folder")
    found = [part for part in sorted(path.rglob("*")) if part.is_file() and may_be_table(part.name)]
    if not found:
        raise IgrowError(f"{path}: no telemetry in it: CSV, Excel or Parquet files are needed")
    return found


def _is_telemetry(path: Path) -> bool:
    """Tell whether a text file's first line is `time` and names of the registry."""
    if path.name.lower().endswith((".parquet", *EXCEL)):
        return False
    try:
        with gzip.open(path, "rb") if path.suffix == ".gz" else path.open("rb") as file:
            first = file.readline().decode("utf-8-sig", errors="replace")
    except (OSError, EOFError, zlib.error):
        return False
    names = [name.strip() for name in first.strip().split(",")]
    return len(names) > 1 and names[0] == "time" and all(name in QUANTITIES for name in names[1:])
