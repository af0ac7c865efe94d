"""A log at a glance: each quantity over time, with what was set aside in red."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib.dates
import numpy as np
from matplotlib.figure import Figure

from igrow.core.errors import IgrowError
from igrow.core.quantities import QUANTITIES

if TYPE_CHECKING:
    from igrow.trainer.data.log import Log

_MOST_POINTS = 2000
"""Rows of a panel; longer logs are thinned to bands from the lowest to the highest of each stretch."""


class LogFigure(Figure):
    """A figure that a notebook shows by itself."""

    def _repr_svg_(self) -> str:
        text = io.StringIO()
        self.savefig(text, format="svg")
        return text.getvalue()


def plot_log(log: Log, path: str | Path | None = None) -> LogFigure:
    """Return a figure with a panel for each quantity of the log that has a value; written to `path` where given.

    Raises:
        IgrowError: nothing is there to plot, or the file cannot be written.
    """
    table = log.telemetry
    names = [name for name in QUANTITIES if name in table and np.isfinite(table[name]).any()]
    if not names:
        raise IgrowError(f"{log.name}: no quantity has a value to plot")
    figure = LogFigure(figsize=(9.0, 0.4 + 1.05 * len(names)), layout="constrained")
    panels = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    for axes, name in zip(panels, names, strict=True):
        block = max(1, len(table) // _MOST_POINTS)
        whole = len(table) // block * block
        cells = table[name][:whole].reshape(-1, block)
        time = table.time[:whole:block]
        some = np.isfinite(cells).any(axis=1)
        low = np.where(some, np.min(np.where(np.isfinite(cells), cells, np.inf), axis=1), np.nan)
        high = np.where(some, np.max(np.where(np.isfinite(cells), cells, -np.inf), axis=1), np.nan)
        axes.fill_between(time, low, high, color="#3b7dd8", linewidth=0.6, edgecolor="#3b7dd8")
        for one in log.screened:
            if one.quantity == name:
                axes.axvspan(one.start, one.end, color="#d33", alpha=0.4)
        axes.set_ylabel(QUANTITIES[name].unit, fontsize=7)
        axes.set_title(name.replace("_", " "), loc="left", fontsize=8, pad=2)
        axes.tick_params(labelsize=7)
        axes.grid(alpha=0.3)
    locator = matplotlib.dates.AutoDateLocator()  # type: ignore[no-untyped-call]
    panels[-1].xaxis.set_major_locator(locator)
    formatter = matplotlib.dates.ConciseDateFormatter(locator)  # type: ignore[no-untyped-call]
    panels[-1].xaxis.set_major_formatter(formatter)
    if path is not None:
        try:
            figure.savefig(Path(path))
        except (OSError, ValueError) as error:
            raise IgrowError(f"{path}: the plot cannot be written: {error}") from None
    return figure
