"""A log at a glance: each quantity over local time, with what was set aside in red."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from igrow.core.errors import IgrowError
from igrow.core.language import ENGLISH, Language
from igrow.core.quantities import QUANTITIES
from igrow.core.telemetry import Telemetry
from igrow.trainer.data.screening import Screened
from igrow.trainer.figure_style import COLOURS, WIDTH, date_axis, few_ticks, local, name_above, panels, thinned

_MOST_POINTS = 1000
"""Rows of a panel; longer logs are thinned to bands from the lowest to the highest of each stretch."""


def plot_log(
    name: str,
    table: Telemetry,
    screened: Sequence[Screened],
    path: str | Path | None = None,
    *,
    only: Collection[str] = (),
    language: Language = ENGLISH,
    width: float = 2.0 * WIDTH,
) -> Figure:
    """Return a figure with a panel for each quantity of the log that has a value; written to `path` where given.

    Args:
        name: of the log, for the error.
        table: to be shown, on a regular grid.
        screened: stretches that were set aside.
        path: of the picture; its ending says the format.
        only: quantities to show (empty: all).
        language: of names and dates, with the time zone of the axis.
        width: inches.

    Raises:
        IgrowError: nothing is there to plot, or the file cannot be written.
    """
    quantities = [
        quantity
        for quantity in QUANTITIES
        if (not only or quantity in only) and quantity in table and np.isfinite(table[quantity]).any()
    ]  # fmt: skip
    if not quantities:
        raise IgrowError(f"{name}: no quantity has a value to plot")
    figure, places = panels(len(quantities), 0.4 + 0.95 * len(quantities), width=width)
    block = max(1, len(table) // _MOST_POINTS)
    time = local(table.time[: len(table) // block * block : block], language)
    for axes, quantity in zip(places, quantities, strict=True):
        low, high = thinned(language.shown(QUANTITIES[quantity].unit).all(table[quantity]), block)
        colour = COLOURS.get(quantity, COLOURS["weather"])
        axes.fill_between(time, low, high, color=colour, linewidth=0.8, edgecolor=colour)
        for one in screened:
            if one.quantity == quantity:
                first, last = local([one.start, one.end], language)
                axes.axvspan(first, last, color=COLOURS["aside"], alpha=0.45, linewidth=1.0)
        unit = language.unit(QUANTITIES[quantity].unit)
        name_above(axes, f"{language.name(quantity)}{f', {unit}' if unit else ''}")
        few_ticks(axes, 3)
    date_axis(places[-1], language)
    if path is not None:
        try:
            figure.savefig(Path(path), facecolor="white")
        except (OSError, ValueError) as error:
            raise IgrowError(f"{path}: the plot cannot be written: {error}") from None
    return figure
