"""Inline SVG: small lines beside a number, and one chart of the day with the plan ahead."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta, tzinfo

from igrow.edge.status.history import Series


@dataclass(frozen=True)
class Line:
    """One line of a chart."""

    label: str
    series: Series
    style: str
    """Class in the style sheet: its colour and dashes."""
    stepped: bool = False
    """Setpoints hold until the next; measurements do not."""


def sparkline(series: Series, *, width: int = 150, height: int = 36) -> str:
    """Return a small line without axes; empty for fewer than two points."""
    if len(series) < 2:
        return ""
    x, y = _scales([series], 3, width - 4, height - 4, 4)
    points = " ".join(f"{x(time):.1f},{y(value):.1f}" for time, value in series)
    last_time, last_value = series[-1]
    return (
        f'<svg class="spark" viewBox="0 0 {width} {height}" width="{width}" height="{height}" aria-hidden="true">'
        f'<polyline points="{points}"/><circle cx="{x(last_time):.1f}" cy="{y(last_value):.1f}" r="2.5"/></svg>'
    )


def day_chart(lines: Sequence[Line], now: float, unit: str, zone: tzinfo) -> str:
    """Return the chart of the last day and of the plan ahead; empty where there is nothing to draw."""
    lines = [line for line in lines if len(line.series) >= 2]
    if not lines:
        return ""
    width, height, left, bottom, top = 760, 220, 40, 24, 8
    x, y = _scales([line.series for line in lines], left, width - 10, height - bottom, top)
    start = min(line.series[0][0] for line in lines)
    end = max(line.series[-1][0] for line in lines)
    values = [value for line in lines for _, value in line.series]
    parts = [f'<svg class="chart" viewBox="0 0 {width} {height}" role="img" aria-label="the last day and the plan">']
    for tick in _ticks(min(values), max(values)):
        parts.append(
            f'<line class="grid" x1="{left}" x2="{width - 10}" y1="{y(tick):.1f}" y2="{y(tick):.1f}"/>'
            f'<text class="axis" x="{left - 6}" y="{y(tick) + 4:.1f}" text-anchor="end">{tick:g}</text>'
        )
    for moment, text in _hours(start, end, zone):
        parts.append(
            f'<text class="axis" x="{x(moment):.1f}" y="{height - 6}" text-anchor="middle">{text}</text>'
            f'<line class="grid" x1="{x(moment):.1f}" x2="{x(moment):.1f}" y1="{top}" y2="{height - bottom}"/>'
        )
    if start < now < end:
        parts.append(
            f'<rect class="ahead" x="{x(now):.1f}" y="{top}" width="{x(end) - x(now):.1f}" '
            f'height="{height - bottom - top}"/>'
            f'<text class="now" x="{x(now) + 5:.1f}" y="{top + 12}">expected</text>'
        )
    for line in lines:
        path = _stepped(line.series) if line.stepped else line.series
        points = " ".join(f"{x(time):.1f},{y(value):.1f}" for time, value in path)
        parts.append(f'<polyline class="{line.style}" points="{points}"/>')
    parts.append(f'<text class="axis" x="{left - 6}" y="{height - 6}" text-anchor="end">{unit}</text></svg>')
    legend = "".join(f'<span class="key {line.style}">{line.label}</span>' for line in lines)
    return f'<div class="legend">{legend}</div>{"".join(parts)}'


def _scales(series: Sequence[Series], left: float, right: float, bottom: float, top: float):  # type: ignore[no-untyped-def]
    """Return the functions from time to x and from value to y."""
    times = [time for line in series for time, _ in line]
    values = [value for line in series for _, value in line]
    first, span = min(times), (max(times) - min(times)) or 1.0
    low, height = min(values), max(values) - min(values)
    if height < 1e-9:
        low, height = low - 0.5, 1.0
    return (
        lambda time: left + (time - first) / span * (right - left),
        lambda value: bottom - (value - low) / height * (bottom - top),
    )


def _stepped(series: Series) -> list[tuple[float, float]]:
    points = [series[0]]
    for (_, before), (time, value) in itertools.pairwise(series):
        points += [(time, before), (time, value)]
    return points


def _ticks(low: float, high: float) -> list[float]:
    """Return three to six round numbers within the range."""
    span = max(high - low, 1e-9)
    step = 10.0 ** math.floor(math.log10(span / 3.0))
    step *= next(factor for factor in (1, 2, 5, 10) if span / (step * factor) <= 5.0)
    return [round(index * step, 10) for index in range(math.ceil(low / step), math.floor(high / step) + 1)]


def _hours(start: float, end: float, zone: tzinfo) -> list[tuple[float, str]]:
    """Return the full six hours of local time in the range, with their names."""
    hour = datetime.fromtimestamp(start, zone).replace(minute=0, second=0, microsecond=0)
    found = []
    while (moment := hour.timestamp()) <= end:
        if moment >= start and hour.hour % 6 == 0:
            found.append((moment, f"{hour:%H:%M}" if hour.hour else f"{hour:%a %d}"))
        hour = datetime.fromtimestamp((hour + timedelta(hours=1)).timestamp(), zone)
    return found
