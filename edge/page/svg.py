"""Charts as inline SVG: pure functions from series to markup, without a script and without a style of their own.

Colours, widths and dashes are classes of `templates/page.css`; lines differ in their dashes too, so that nobody needs
the colours. Times are seconds since 1970 UTC.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import timedelta
from html import escape

import numpy as np

from igrow.core.arrays import Floats
from igrow.edge.page.words import Words


@dataclass(frozen=True)
class Line:
    """One quantity over time."""

    label: str
    style: str
    time: Floats
    value: Floats
    low: Floats | None = None
    """With `high`: the least and greatest value around each point, drawn as a faint ribbon."""
    high: Floats | None = None
    stepped: bool = False
    """It holds until the next point, as setpoints do."""
    gap: float = math.inf
    """Points farther apart than so many seconds are not joined."""


@dataclass(frozen=True)
class Band:
    """What is allowed, over time; it holds until the next point."""

    label: str
    time: Floats
    low: Floats
    high: Floats


@dataclass(frozen=True)
class Limit:
    """A value that should not be passed."""

    label: str
    value: float


@dataclass(frozen=True)
class Stretch:
    """A time in which something stood in the way."""

    label: str
    start: float
    end: float


@dataclass(frozen=True)
class Frame:
    """What a chart shows."""

    start: float
    end: float
    now: float
    say: Words
    least_span: float = 1.0
    """The scale spans at least so much, so that noise looks like noise."""


@dataclass(frozen=True)
class Size:
    """In pixels, as it is meant to be seen."""

    width: int
    height: int


LEFT, RIGHT, TOP, BOTTOM = 44, 8, 16, 24
Place = Callable[[float], float]


def chart(
    summary: str,
    lines: Sequence[Line],
    frame: Frame,
    size: Size,
    *,
    bands: Sequence[Band] = (),
    limits: Sequence[Limit] = (),
    stretches: Sequence[Stretch] = (),
) -> str:
    """Return a chart; `summary` is what is said to those who do not see it. Empty where there is nothing to draw."""
    lines = [line for line in lines if len(line.time)]
    if not lines:
        return ""
    low, high = value_range(lines, bands, limits, frame.least_span)
    inside = [limit for limit in limits if low <= limit.value <= high]

    def x(time: float) -> float:
        share = (time - frame.start) / max(frame.end - frame.start, 1.0)
        return LEFT + min(max(share, 0.0), 1.0) * (size.width - LEFT - RIGHT)

    def y(value: float) -> float:
        return size.height - BOTTOM - (value - low) / (high - low) * (size.height - TOP - BOTTOM)

    parts = [
        f'<svg class="chart" viewBox="0 0 {size.width} {size.height}" role="img" aria-label="{escape(summary)}">',
        *(_band(band, x, y, frame.end) for band in bands),
        *_grid(frame, size, x, y, (low, high)),
        *_ahead(frame, size, x),
        *(_ribbon(line, x, y) for line in lines if line.low is not None),
        *(_limit(limit, size, y) for limit in inside),
        *(_line(line, x, y, frame.end) for line in lines),
        *(_stretch(stretch, size, x) for stretch in stretches),
        "</svg>",
    ]
    return "".join(parts)


def spark(time: Floats, value: Floats) -> str:
    """Return a small line without axes; empty for fewer than two points."""
    width, height = 150, 34
    if len(time) < 2:
        return ""
    low, span = float(np.min(value)), max(float(np.ptp(value)), 1e-9)
    first, length = float(time[0]), max(float(time[-1] - time[0]), 1.0)
    points = [
        (3 + (t - first) / length * (width - 7), height - 4 - (v - low) / span * (height - 8))
        for t, v in zip(time.tolist(), value.tolist(), strict=True)
    ]
    path = " ".join(f"{a:.1f},{b:.1f}" for a, b in points)
    end_x, end_y = points[-1]
    return (
        f'<svg class="spark" viewBox="0 0 {width} {height}" width="{width}" height="{height}" aria-hidden="true">'
        f'<polyline points="{path}"/><circle cx="{end_x:.1f}" cy="{end_y:.1f}" r="2.5"/></svg>'
    )


def swatch(style: str) -> str:
    """Return what a line of a style looks like, for a legend."""
    shape = (
        f'<rect class="{style}" x="0" y="2" width="26" height="8"/>'
        if style in ("band", "binds")
        else f'<path class="{style}" d="M0 6H26"/>'
    )
    return f'<svg class="swatch" viewBox="0 0 26 12" width="26" height="12" aria-hidden="true">{shape}</svg>'


def value_range(
    lines: Sequence[Line], bands: Sequence[Band], limits: Sequence[Limit], least_span: float
) -> tuple[float, float]:
    """Return the ends of the scale: all lines and bands, and limits that lie near them."""
    values = np.concatenate(
        [np.asarray(one) for line in lines for one in (line.value, line.low, line.high) if one is not None]
        + [one for band in bands for one in (band.low, band.high)]
    )
    values = values[np.isfinite(values)]
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
    for limit in limits:
        near = 0.35 * max(high - low, least_span)
        if low - near <= limit.value <= high + near:
            low, high = min(low, limit.value), max(high, limit.value)
    if high - low < least_span:
        middle = 0.5 * (low + high)
        low, high = middle - 0.5 * least_span, middle + 0.5 * least_span
    edge = 0.04 * (high - low)
    return low - edge, high + edge


def ticks(low: float, high: float) -> list[float]:
    """Return two to five round numbers within a range."""
    span = max(high - low, 1e-9)
    step = 10.0 ** math.floor(math.log10(span / 3.0))
    step *= next(factor for factor in (1, 2, 5, 10) if span / (step * factor) <= 5.0)
    return [round(index * step, 10) for index in range(math.ceil(low / step), math.floor(high / step) + 1)]


def time_ticks(start: float, end: float, say: Words, most: int) -> Iterator[tuple[float, str]]:
    """Yield at most so many round local times of a range with their names; midnights are named by their day."""
    hours = (end - start) / 3600.0
    step = next((step for step in (3, 6, 12, 24, 48, 120, 240) if hours / step <= most), 480)
    moment = say.local(start).replace(hour=0, minute=0, second=0, microsecond=0)
    while (time := moment.timestamp()) <= end:
        if time >= start:
            name = f"{moment:%H:%M}" if moment.hour else say.date(time, "weekday" if step <= 48 else "short_day")
            yield time, name
        # On the wall's clock, so that midnight stays midnight over a change of the clocks.
        moment = moment + timedelta(hours=step)


def _grid(frame: Frame, size: Size, x: Place, y: Place, ends: tuple[float, float]) -> Iterator[str]:
    right, floor = size.width - RIGHT, size.height - BOTTOM
    for tick in ticks(*ends):
        value = frame.say.language.number(tick, 6)
        yield (
            f'<path class="grid" d="M{LEFT} {y(tick):.1f}H{right}"/>'
            f'<text class="axis" x="{LEFT - 6}" y="{y(tick) + 4:.1f}" text-anchor="end">{value}</text>'
        )
    for time, name in time_ticks(frame.start, frame.end, frame.say, size.width // 75):
        yield f'<path class="grid" d="M{x(time):.1f} {TOP}V{floor}"/>'
        if LEFT + 14 <= x(time) <= right - 14:
            at = f'x="{x(time):.1f}" y="{size.height - 6}"'
            yield f'<text class="axis" {at} text-anchor="middle">{escape(name)}</text>'


def _ahead(frame: Frame, size: Size, x: Place) -> Iterator[str]:
    if frame.start < frame.now < frame.end:
        at, floor = x(frame.now), size.height - BOTTOM
        width = size.width - RIGHT - at
        yield f'<rect class="ahead" x="{at:.1f}" y="{TOP}" width="{width:.1f}" height="{floor - TOP}"/>'
        yield f'<path class="present" d="M{at:.1f} {TOP}V{floor}"/>'
        if width > 44:
            yield f'<text class="present" x="{at + 4:.1f}" y="{TOP - 4}">{escape(frame.say.text("ahead"))}</text>'


def _corners(time: Floats, value: Floats, end: float) -> list[tuple[float, float]]:
    """Return the corners of a course that holds each value until the next."""
    ends = [*time[1:].tolist(), max(end, float(time[-1]))]
    return [
        corner
        for begin, until, held in zip(time.tolist(), ends, value.tolist(), strict=True)
        for corner in ((begin, held), (until, held))
    ]


def _line(line: Line, x: Place, y: Place, end: float) -> str:
    points = list(zip(line.time.tolist(), line.value.tolist(), strict=True))
    if line.stepped:
        held = float(line.time[-1] - line.time[-2]) if len(line.time) > 1 else 0.0
        points = _corners(line.time, line.value, min(end, float(line.time[-1]) + held))
    path: list[str] = []
    before = -math.inf
    for time, value in points:
        joined = time - before <= line.gap
        path.append(f"{'L' if joined and path else 'M'}{x(time):.1f} {y(value):.1f}")
        before = time
    return f'<path class="line {line.style}" d="{"".join(path)}"/>'


def _ribbon(line: Line, x: Place, y: Place) -> str:
    """Return the area between least and greatest values, broken where the line is."""
    assert line.low is not None and line.high is not None
    breaks = np.flatnonzero(np.diff(line.time) > line.gap) + 1
    areas = []
    for rows in np.split(np.arange(len(line.time)), breaks):
        there = [f"{x(line.time[k]):.1f} {y(line.high[k]):.1f}" for k in rows]
        back = [f"{x(line.time[k]):.1f} {y(line.low[k]):.1f}" for k in rows[::-1]]
        areas.append("M" + "L".join(there + back) + "Z")
    return f'<path class="ribbon {line.style}" d="{"".join(areas)}"/>'


def _band(band: Band, x: Place, y: Place, end: float) -> str:
    if not len(band.time):
        return ""
    upper, lower = _corners(band.time, band.high, end), _corners(band.time, band.low, end)
    points = [f"{x(time):.1f} {y(value):.1f}" for time, value in (*upper, *lower[::-1])]
    return f'<path class="band" d="M{"L".join(points)}Z"/>'


def _limit(limit: Limit, size: Size, y: Place) -> str:
    at = y(limit.value)
    text_at = at - 4 if at > TOP + 16 else at + 13
    return (
        f'<path class="limit" d="M{LEFT} {at:.1f}H{size.width - RIGHT}"/>'
        f'<text class="limit" x="{LEFT + 4}" y="{text_at:.1f}">{escape(limit.label)}</text>'
    )


def _stretch(stretch: Stretch, size: Size, x: Place) -> str:
    left, right = x(stretch.start), x(stretch.end)
    floor = size.height - BOTTOM
    return (
        f'<rect class="binds" x="{left:.1f}" y="{floor - 6}" width="{max(right - left, 3.0):.1f}" height="6">'
        f"<title>{escape(stretch.label)}</title></rect>"
    )
