"""A log at a glance: each quantity over local time, with what was set aside in red."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from igrow.core.errors import IgrowError
from igrow.core.language import ENGLISH, Language
from igrow.core.quantities import QUANTITIES
from igrow.trainer.figure_style import COLOURS, WIDTH, date_axis, few_ticks, local, name_above, panels, thinned

if TYPE_CHECKING:
    from igrow.trainer.data.log import Log

_MOST_POINTS = 1000
"""Rows of a panel; longer logs are thinned to bands from the lowest to the highest of each stretch."""


def plot_log(
    log: Log,
    path: str | Path | None = None,
    *,
    only: Collection[str] = (),
    language: Language = ENGLISH,
    width: float = 2.0 * WIDTH,
) -> Figure:
    """Return a figure with a panel for each quantity of the log that has a value; written to `path` where given.

    Args:
        log: to be shown.
        path: of the picture; its ending says the format.
        only: quantities to show (empty: all).
        language: of names and dates, with the time zone of the axis.
        width: inches.

    Raises:
        IgrowError: nothing is there to plot, or the file cannot be written.
    """
    table = log.telemetry
    names = [
        name
        for name in QUANTITIES
        if (not only or name in only) and name in table and np.isfinite(table[name]).any()
    ]  # fmt: skip
    if not names:
        raise IgrowError(f"{log.name}: no quantity has a value to plot")
    figure, places = panels(len(names), 0.4 + 0.95 * len(names), width=width)
    block = max(1, len(table) // _MOST_POINTS)
    time = local(table.time[: len(table) // block * block : block], language)
    for axes, name in zip(places, names, strict=True):
        low, high = thinned(language.shown(QUANTITIES[name].unit).all(table[name]), block)
        colour = COLOURS.get(name, COLOURS["weather"])
        axes.fill_between(time, low, high, color=colour, linewidth=0.8, edgecolor=colour)
        for one in log.screened:
            if one.quantity == name:
                first, last = local([one.start, one.end], language)
                axes.axvspan(first, last, color=COLOURS["aside"], alpha=0.45, linewidth=1.0)
        unit = language.unit(QUANTITIES[name].unit)
        name_above(axes, f"{language.name(name)}{f', {unit}' if unit else ''}")
        few_ticks(axes, 3)
    date_axis(places[-1], language)
    if path is not None:
        try:
            figure.savefig(Path(path), facecolor="white")
        except (OSError, ValueError) as error:
            raise IgrowError(f"{path}: the plot cannot be written: {error}") from None
    return figure
