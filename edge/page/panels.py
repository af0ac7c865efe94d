"""The charts of the page: which lines, bands and limits each has, from the log and the plan."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import tzinfo
from typing import Any

import numpy as np
from markupsafe import Markup

from igrow.core.agronomy import Place
from igrow.core.agronomy.moment import moment
from igrow.core.site import Site
from igrow.edge.page import words
from igrow.edge.page.history import Course, Span
from igrow.edge.page.plan import binding
from igrow.edge.page.svg import Band, Frame, Limit, Line, Size, Stretch, chart, swatch

WIDE, NARROW = 920, 350
"""Widths of a chart, on a desk and on a telephone; the style sheet shows one of them."""
BAND_STEP = 900.0
"""Seconds between two looks at whether the sun is up."""


@dataclass(frozen=True)
class Panel:
    """One chart with what stands around it."""

    title: str
    unit: str
    wide: Markup
    narrow: Markup
    legend: tuple[tuple[Markup, str], ...]
    folded: bool = False
    """Shown only when asked for."""


@dataclass(frozen=True)
class Sketch:
    """What a panel is made of."""

    title: str
    measured: tuple[tuple[str, str], ...]
    """(quantity, style)."""
    setpoint: str = ""
    least_span: float = 1.0
    folded: bool = False
    height: int = 210


SKETCHES = (
    Sketch("Temperature", (("air_temperature", "measured"),), "heating_setpoint", 4.0, height=240),
    Sketch("Humidity", (("air_humidity", "measured"),), "", 20.0),
    Sketch("CO₂", (("air_co2", "measured"),), "co2_setpoint", 200.0),
    Sketch("Light at the crop", (("par", "measured"),), "", 200.0),
    Sketch("Lamps", (), "lamp_on", 100.0, height=100),
    Sketch("Irrigation", (), "irrigation_on", 100.0, height=100),
    Sketch("Temperature outside", (("outdoor_temperature", "measured"),), "", 4.0, True),
    Sketch("Sun outside", (("global_radiation", "measured"),), "", 200.0, True),
    Sketch("Wind", (("wind_speed", "measured"),), "", 4.0, True),
    Sketch(
        "Heating pipes", (("rail_pipe_temperature", "measured"), ("grow_pipe_temperature", "other")), "", 10.0, True
    ),
    Sketch("Vents", (("vent_lee", "measured"), ("vent_wind", "other")), "", 100.0, True),
    Sketch("Screens", (("energy_screen", "measured"), ("blackout_screen", "other")), "", 100.0, True),
)


def panels(
    courses: Mapping[str, Course], state: Mapping[str, Any], site: Site, span: Span, now: float, zone: tzinfo
) -> list[Panel]:
    """Return the charts over a span back and the plan ahead; what the site does not measure has none."""
    plan = state.get("plan")
    end = now if plan is None else plan["start"] + plan["step_seconds"] * _steps(plan)
    drawn = []
    for sketch in SKETCHES:
        frame = Frame(now - span.seconds, max(end, now), now, zone, sketch.least_span)
        lines = _lines(sketch, courses, plan, span, now)
        if not any(len(line.time) for line in lines):
            continue
        name = sketch.measured[0][0] if sketch.measured else sketch.setpoint
        bands, limits = _allowed(sketch, site, frame, span)
        stretches = [one for one in binding(plan, sketch.setpoint, site.crop.agronomy) if one.end > now]
        summary = describe(sketch, lines, name, span)
        sizes = (Size(WIDE, sketch.height), Size(NARROW, sketch.height))
        wide, narrow = (
            Markup(chart(summary, lines, frame, size, bands=bands, limits=limits, stretches=stretches))
            for size in sizes
        )
        legend = _legend(lines, bands, limits, stretches)
        drawn.append(Panel(sketch.title, words.unit(name), wide, narrow, legend, sketch.folded))
    return drawn


def _steps(plan: Mapping[str, Any]) -> int:
    return min((len(course) for course in plan["setpoints"].values()), default=0)


def _lines(
    sketch: Sketch, courses: Mapping[str, Course], plan: Mapping[str, Any] | None, span: Span, now: float
) -> list[Line]:
    gap = 3.0 * span.bucket
    lines = []
    if sketch.setpoint in courses:
        past, factor = courses[sketch.setpoint], words.scale(sketch.setpoint)
        label = "asked of the PLC" if not sketch.measured else words.title(sketch.setpoint)
        lines.append(Line(label, "setpoint", past.time, past.mean * factor, stepped=True, gap=gap))
    if plan is not None and sketch.setpoint in plan["setpoints"]:
        time, value = ahead(plan, sketch.setpoint, now, at_end=False)
        factor = words.scale(sketch.setpoint)
        lines.append(Line("planned", "planned", time, value * factor, stepped=True, gap=plan["step_seconds"]))
    for name, style in sketch.measured:
        if name in courses:
            past, factor = courses[name], words.scale(name)
            label = "measured" if len(sketch.measured) == 1 else words.title(name)
            low, high = (past.low * factor, past.high * factor) if style == "measured" else (None, None)
            lines.append(Line(label, style, past.time, past.mean * factor, low, high, gap=gap))
        if plan is not None and name in plan["predicted"]:
            time, value = ahead(plan, name, now, at_end=True)
            lines.append(Line("expected", "expected", time, value * words.scale(name)))
    return lines


def ahead(plan: Mapping[str, Any], name: str, now: float, *, at_end: bool) -> tuple[np.ndarray[Any, Any], ...]:
    """Return times and values of what a plan still holds of a quantity; predictions stand at the end of their step.

    The step of a setpoint that is under way begins now.
    """
    value = np.array(plan["predicted" if at_end else "setpoints"][name], dtype=np.float64)
    step = plan["step_seconds"]
    time = plan["start"] + step * (np.arange(len(value)) + float(at_end))
    if at_end:
        told = (time > now) & np.isfinite(value)
        return time[told], value[told]
    still = time + step > now
    return np.maximum(time[still], now), value[still]


def _allowed(sketch: Sketch, site: Site, frame: Frame, span: Span) -> tuple[list[Band], list[Limit]]:
    """Return what the crop and the site allow."""
    crop = site.crop
    if sketch.setpoint == "heating_setpoint":
        limits = [
            Limit(f"crop: no colder than {crop.temperature_low:g} °C", crop.temperature_low),
            Limit(f"crop: no hotter than {crop.temperature_high:g} °C", crop.temperature_high),
        ]
        return ([heating_band(site, frame)] if span.seconds <= 86_400 else []), limits
    if sketch.title == "Humidity":
        return [], [Limit(f"crop: no damper than {crop.humidity_high:g} %", crop.humidity_high)]
    if sketch.setpoint == "co2_setpoint":
        rule = site.limits.co2_setpoint
        ends = np.array([frame.start])
        return [Band("allowed for the setpoint", ends, np.array([rule.low]), np.array([rule.high]))], []
    return [], []


def heating_band(site: Site, frame: Frame) -> Band:
    """Return what the crop allows the heating setpoint, which changes with the sun."""
    place, agronomy = Place.of(site), site.crop.agronomy
    times = np.arange(frame.start, frame.end, BAND_STEP)
    up = [moment(place, time).sun_up for time in times.tolist()]
    changes = [0, *(k for k in range(1, len(up)) if up[k] != up[k - 1])]
    bands = [agronomy.day_temperature if up[k] else agronomy.night_temperature for k in changes]
    low, high = np.array([band.low for band in bands]), np.array([band.high for band in bands])
    return Band("allowed for the setpoint, by day and night", times[changes], low, high)


def _legend(
    lines: list[Line], bands: list[Band], limits: list[Limit], stretches: list[Stretch]
) -> tuple[tuple[Markup, str], ...]:
    entries = [(f"line {line.style}", line.label) for line in lines if len(line.time)]
    entries += [("band", band.label) for band in bands]
    entries += [("limit", "limit of the crop")] if limits else []
    if stretches:
        entries.append(("binds", "the plan is held by: " + "; ".join(dict.fromkeys(one.label for one in stretches))))
    return tuple((Markup(swatch(style)), label) for style, label in entries)


def describe(sketch: Sketch, lines: list[Line], name: str, span: Span) -> str:
    """Return a chart in one sentence, for those who do not see it."""
    told = []
    for line in lines:
        if len(line.value):
            low, high = float(np.min(line.value)), float(np.max(line.value))
            scale = words.scale(name)
            ends = f"{words.number(name, low / scale)} to {words.number(name, high / scale)} {words.unit(name)}"
            told.append(f"{line.label} {ends}")
    return f"{sketch.title}, last {span.title} and the plan: {'; '.join(told)}"
