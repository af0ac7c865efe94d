"""What the updates let the process for graphs do: to read, try and judge bundles. Nothing here runs in the daemon.

A bundle is signed, and may be bad all the same: its graphs may need all memory, or never end.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from igrow.core.bundle import Bundle
from igrow.core.telemetry import Telemetry, to_grid
from igrow.edge.store.store import StoreError, read_telemetry
from igrow.edge.updates.shadow import Comparison, Predictor, compare, hindcast_errors
from igrow.edge.updates.shelf import Shelf

HOUR = 3600.0
LONGEST_WINDOW = 40 * 24 * HOUR
"""Seconds of log that a comparison reaches back at most, whatever a clock says of when it began."""


def take(shelf: Shelf, archive: Path) -> Bundle:
    """Unpack, check and test a packed bundle; returns it in its place. Raises UpdateError or BundleError."""
    return shelf.put(archive)


def take_folder(shelf: Shelf, folder: Path) -> Bundle:
    """Check and test a bundle that an operator gives as a folder; raises like `take`."""
    return shelf.put_folder(folder)


def read_again(shelf: Shelf, identity: str) -> Bundle:
    """Read a bundle that was taken before; raises BundleError where it has been damaged since."""
    return shelf.get(identity)


def compare_on_log(
    predictor: Predictor, store: Path, step: int, candidate: Bundle, reference: Bundle | None, since: float, time: float
) -> Comparison:
    """Compare two bundles on the log in the folder `store`, on a grid of `step` seconds; raises BundleError."""
    log, start, end = _window(store, step, since, time)
    return compare(predictor, candidate, reference, log, start, end)


def errors_on_log(
    predictor: Predictor, store: Path, step: int, bundle: Bundle, since: float, time: float
) -> dict[str, float]:
    """Return the errors of one bundle on the log, by "<quantity> <horizon>_h"; raises BundleError."""
    log, start, end = _window(store, step, since, time)
    return hindcast_errors(predictor, bundle, log, start, end)


def _window(store: Path, step: int, since: float, time: float) -> tuple[Telemetry, np.datetime64, np.datetime64]:
    """Return the log from a day before `since`, as history for the simulator, on the grid, and the window's ends."""
    since = max(since, time - LONGEST_WINDOW)
    try:
        stored = read_telemetry(store, since - 24 * HOUR, time)
    except StoreError:
        stored = Telemetry(np.empty(0, dtype="datetime64[s]"), {})
    return to_grid(stored, step), np.datetime64(int(since), "s"), np.datetime64(int(time), "s")
