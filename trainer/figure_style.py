"""The one style of all figures: colours, sizes, dates; and a figure as SVG that follows the page it stands in.

On a page each colour is a CSS variable, so that figures turn dark with it; `COLOURS` are their values by light.
"""

from __future__ import annotations

import datetime
import io
import re
import warnings
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

import numpy as np
import yaml
from matplotlib import dates, rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator, ScalarFormatter

from igrow.core.arrays import Floats
from igrow.core.language import Language
from igrow.core.local_time import to_local

_TABLE = yaml.safe_load(files("igrow.trainer").joinpath("figure_style.yaml").read_text(encoding="utf-8"))
COLOURS: Mapping[str, str] = _TABLE["by_light"]
DARK: Mapping[str, str] = _TABLE["by_night"]
_STYLE: Any = _TABLE["matplotlib"]
STROKES: Mapping[str, str] = {"measured": "-", "deployed": ":", "recalibrated": "--", "corrected": "-"}
"""So that nobody depends on colours."""
WIDTH = 4.3
"""Inches: as wide as a telephone shows at the size that it is drawn in."""
_MOST_TICKS = {
    dates.YEARLY: 6, dates.MONTHLY: 7, dates.DAILY: 6, dates.HOURLY: 7, dates.MINUTELY: 8, dates.SECONDLY: 8,
    dates.MICROSECONDLY: 8,
}  # fmt: skip
"""As few as a telephone has room for; with fewer, matplotlib finds no step for some spans and draws every tick."""


class ReportFigure(Figure):
    """A figure that a notebook shows by itself."""

    def _repr_svg_(self) -> str:
        return svg(self)


def panels(count: int = 1, height: float = 2.6, *, width: float = WIDTH) -> tuple[ReportFigure, list[Axes]]:
    """Return a figure with `count` panels one below the other, `height` inches in all."""
    with rc_context(_STYLE):
        figure = ReportFigure(figsize=(width, height), layout="constrained")
        axes = list(figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0])
    for one in axes:
        one.set_axisbelow(True)
    return figure, axes


def name_above(axes: Axes, text: str) -> None:
    """Write what a panel shows above it, where it takes no width."""
    axes.set_title(text, loc="left", fontsize=9, pad=3)


def legend(axes: Axes) -> None:
    """Put the legend above the panel: it hides nothing there."""
    axes.legend(
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=2,
        borderaxespad=0.2,
        handlelength=1.6,
        frameon=False,
        fontsize=8.5,
    )


def date_axis(axes: Axes, language: Language) -> None:
    """Label an axis of local times (`local`) with days."""
    locator = dates.AutoDateLocator(minticks=3, maxticks=_MOST_TICKS)  # type: ignore[no-untyped-call]
    axes.xaxis.set_major_locator(locator)
    clock = Language(language.code, language.translations)

    def label(value: float, _position: int | None = None) -> str:
        moment = dates.num2date(value).replace(tzinfo=None)  # type: ignore[no-untyped-call]
        return clock.short_day(np.datetime64(moment, "s")) if moment.time() == datetime.time() else f"{moment:%H:%M}"

    axes.xaxis.set_major_formatter(FuncFormatter(label))


class _Signs(ScalarFormatter):
    """Numbers on an axis with the signs of a language."""

    def __init__(self, language: Language) -> None:
        super().__init__()
        self._language = language

    def __call__(self, x: float, pos: int | None = None) -> str:
        return self._language.locale.number(str(super().__call__(x, pos)))


def with_signs_of(figure: Figure, language: Language) -> Figure:
    """Return a figure whose axes have their numbers as a language writes them, as the text beside them does."""
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            if type(axis.get_major_formatter()) is ScalarFormatter:
                axis.set_major_formatter(_Signs(language))
    return figure


def few_ticks(axes: Axes, count: int = 4) -> None:
    """Draw few ticks on a low panel."""
    axes.yaxis.set_major_locator(MaxNLocator(count))


def local(time: Any, language: Language) -> Any:
    """Return UTC times as the wall times that people read."""
    return to_local(np.asarray(time), language.time_zone)


def thinned(values: Floats, block: int) -> tuple[Floats, Floats]:
    """Return the lowest and highest value of every `block` rows, NaN without any, (n // block,) each."""
    cells = values[: len(values) // block * block].reshape(-1, block)
    some = np.isfinite(cells).any(axis=1)
    low = np.where(some, np.min(np.where(np.isfinite(cells), cells, np.inf), axis=1), np.nan)
    high = np.where(some, np.max(np.where(np.isfinite(cells), cells, -np.inf), axis=1), np.nan)
    return low, high


def svg(figure: Figure, *, on_page: bool = False) -> str:
    """Return a figure as an SVG element; `on_page`: in the colours of the page, without ids that could clash."""
    buffer = io.StringIO()
    with rc_context(_STYLE), warnings.catch_warnings():
        # The page's own fonts have the signs that matplotlib's lacks.
        warnings.filterwarnings("ignore", message=".*[Gg]lyph.*missing.*")
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    if not on_page:
        return text
    for name, colour in COLOURS.items():
        text = text.replace(colour, f"var(--{name.replace('_', '-')})")
    text = re.sub(r'<g id="[a-z0-9]+_\d+">', "<g>", text)
    text = re.sub(r'<text style="[^"]*?(?:text-anchor: (\w+))?[^"]*"', _text_style, text)
    return re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)


def _text_style(found: re.Match[str]) -> str:
    """Keep a text's anchor and size; font and colour are the page's."""
    style = found[0]
    size = re.search(r"font(?:-size)?: (?:\w+ )*?([\d.]+)px", style)
    anchor = re.search(r"text-anchor: (\w+)", style)
    kept = [f"font-size: {size[1]}px"] if size else []
    kept += [f"text-anchor: {anchor[1]}"] if anchor else []
    return f'<text style="{"; ".join(kept)}"'
