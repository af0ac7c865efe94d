"""One door for every kind of log, so that the same command runs on whatever folder or file it is given."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from igrow.core.errors import IgrowError
from igrow.trainer.data import telemetry_files
from igrow.trainer.data.public import agc2018, agc2019
from igrow.trainer.data.source import Source


def open_source(
    path: str | Path | Sequence[str | Path], compartment: str | None = None, mapping: str | Path | None = None
) -> Source:
    """Return the log of one greenhouse as it stands in its files.

    Args:
        path: a folder of the first or second Autonomous Greenhouse Challenge (or a compartment's folder in it), or
            telemetry: a file (CSV, gzip or not, Parquet), several, or a folder of them such as an exchange's. A
            grower's own export comes with a mapping (`igrow.trainer.data.mapping`).
        compartment: its name, where the folder has several.
        mapping: file that says what the export's columns are; else one that stands beside the files is taken.

    Raises:
        IgrowError: nothing readable is there, or a compartment must be named.
    """
    translation = None if mapping is None else Path(mapping)
    if not isinstance(path, str | Path):
        return _read_files([Path(part) for part in path], translation)
    place = Path(path)
    if not place.exists():
        raise IgrowError(f"{place}: there is no such file or folder")
    if place.is_dir() and translation is None:
        for recognises, read in ((agc2019.recognises, agc2019.read), (agc2018.recognises, agc2018.read)):
            if recognises(place):
                return read(place, compartment)
            if compartment is None and recognises(place.resolve().parent):
                return read(place.resolve().parent, place.resolve().name)
    if compartment is not None and place.is_dir() and (place / compartment).is_dir():
        place = place / compartment
    return _read_files([place], translation)


def _read_files(paths: Sequence[Path], translation: Path | None) -> Source:
    """Read telemetry or exports; an error names the command that finds out how a file is to be read."""
    try:
        return telemetry_files.read(paths, translation)
    except IgrowError as error:
        place = next((path for path in paths if path.exists()), None)
        hint = "" if place is None else f" (`igrow-trainer import {place}` finds out how it is to be read)"
        raise IgrowError(f"{error}{hint}") from None
