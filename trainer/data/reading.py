"""From any source to a `Log`: read, screened, put on the grid; the one way in for every command and benchmark."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np

from igrow.core.errors import IgrowError
from igrow.core.site import Site, load_site
from igrow.core.telemetry import Telemetry
from igrow.trainer.data.grid import HOUR, on_grid, own_step
from igrow.trainer.data.log import Log
from igrow.trainer.data.open_source import open_source
from igrow.trainer.data.plausibility import find_faults
from igrow.trainer.data.rows import without_strays
from igrow.trainer.data.screening import screen
from igrow.trainer.data.source import Source
from igrow.trainer.given import must_be


def read_log(
    path: str | Path | Sequence[str | Path],
    site: Site | str | Path | None = None,
    *,
    compartment: str | None = None,
    mapping: str | Path | None = None,
    accept: Collection[str] = (),
) -> Log:
    """Return the log of one greenhouse from whatever holds it.

        log = read_log("export.csv", "site.yaml")

    Args:
        path: telemetry files (CSV, gzip or not, Parquet), a folder of them, an exchange's folder, a grower's export
            with its mapping, or a folder of a known public data set.
        site: the greenhouse, or its YAML file; None: the one that a public data set brings, else unknown.
        compartment: its name, where a folder has several.
        mapping: file that says what an export's columns are; None: one that stands beside the export.
        accept: kinds of data faults that are known not to be any, such as ``clock`` in a valley without morning sun.

    Raises:
        IgrowError: with file and line, where something cannot be read.
    """
    if not isinstance(path, str | Path | Sequence):
        raise IgrowError(f"a path is needed, not a {type(path).__name__}: prepare_log takes telemetry in memory")
    given = load_site(site) if isinstance(site, str | Path) else site
    source = open_source(path, compartment, mapping)
    return _prepared(source, given or source.site, accept)


def prepare_log(telemetry: Telemetry, site: Site | None = None, *, name: str = "log") -> Log:
    """Return the log of a table in memory, screened and put on the grid as `read_log` does it."""
    must_be(Telemetry, telemetry, "Telemetry(times, columns) makes one, read_log reads files")
    return _prepared(Source(name, telemetry), site)


def _prepared(source: Source, site: Site | None, accept: Collection[str] = ()) -> Log:
    if len(source.telemetry) == 0:
        raise IgrowError(f"{source.name}: the log has no rows (`igrow-trainer import` shows what is read of an export)")
    telemetry, strays = without_strays(source.telemetry)
    found = (*source.faults, *find_faults(telemetry, site))
    accepted = tuple(f"accepted although {fault.sentence}" for fault in found if fault.kind in accept)
    faults = [fault for fault in found if fault.kind not in accept]
    if not own_step(telemetry.time) <= HOUR:
        return Log(source.name, telemetry, site, source.notes, faults=tuple(faults))
    screened = screen(telemetry)
    table = on_grid(screened.telemetry)
    # What a wrong unit pushes out of range is no sensor's fault.
    wrong = {name for fault in faults for name in fault.quantity.split(", ")}
    faults += [fault for fault in screened.faults if fault.quantity not in wrong]
    notes = [
        *source.notes,
        *strays,
        *accepted,
        *screened.notes,
        *_grid_notes(telemetry, table),
        *_unjudged(table, site),
    ]
    return Log(
        source.name, table, site, tuple(notes), screened.screened, tuple(faults), source.harvests, source.resources
    )


def _unjudged(table: Telemetry, site: Site | None) -> list[str]:
    """Say what of a log nobody can judge, and why."""

    def told(name: str) -> bool:
        return name in table and bool(np.isfinite(table[name]).any())

    notes = []
    if site is not None and site.greenhouse.co2_dosing_capacity > 0.0 and told("air_co2") and not told("co2_dosing"):
        notes.append("air_co2 cannot be judged: the log does not tell how much CO2 was dosed")
    if not told("global_radiation"):
        notes.append("without global_radiation the log's clock could not be held against the sun")
    return notes


def _grid_notes(telemetry: Telemetry, table: Telemetry) -> list[str]:
    """Say what the grid changed."""
    off = int((~np.isin(telemetry.time, table.time)).sum())
    minutes = f"{table.step / 60.0:g} min"
    return (
        [f"{off} of {len(telemetry)} rows lay between the times of the grid of {minutes}: snapped to it"] if off else []
    )
