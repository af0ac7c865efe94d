"""One door for every kind of log, so that the same command runs on whatever folder or file it is given."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from igrow.core.errors import IgrowError
from igrow.trainer.readers import agc2018, agc2019, telemetry_files
from igrow.trainer.readers.log import Log


def open_log(path: str | Path | Sequence[str | Path], compartment: str | None = None) -> Log:
    """Return the log of one greenhouse.

    Args:
        path: a folder of the first or second Autonomous Greenhouse Challenge (or a compartment's folder in it), or
            telemetry: a file (CSV, gzip or not, Parquet), several, or a folder of them such as an exchange's. A
            folder with a `mapping.yaml` holds a grower's own export (`igrow.trainer.readers.mapping`).
        compartment: its name, where the folder has several.

    Raises:
        IgrowError: nothing readable is there, or a compartment must be named.
    """
    if not isinstance(path, str | Path):
        return telemetry_files.read([Path(part) for part in path])
    place = Path(path)
    if not place.exists():
        raise IgrowError(f"{place}: there is no such file or folder")
    if place.is_dir():
        for recognises, read in ((agc2019.recognises, agc2019.read), (agc2018.recognises, agc2018.read)):
            if recognises(place):
                return read(place, compartment)
            if compartment is None and recognises(place.resolve().parent):
                return read(place.resolve().parent, place.resolve().name)
    if compartment is not None and place.is_dir() and (place / compartment).is_dir():
        place = place / compartment
    return telemetry_files.read([place])
