"""The charts of the page: which lines, bands and limits each has, from the log and the plan."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup

from igrow.core.agronomy import Place
from igrow.core.agronomy.moment import moment
from igrow.core.language import N_
from igrow.core.site import Site
from igrow.edge.page.history import Course, Span
from igrow.edge.page.plan import binding
from igrow.edge.page.svg import Band, Frame, Limit, Line, Size, Stretch, chart, swatch
from igrow.edge.page.words import Words

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
    Sketch(N_("Temperature"), (("air_temperature", "measured"),), "heating_setpoint", 4.0, height=240),
    Sketch(N_("Humidity"), (("air_humidity", "measured"),), "humidity_setpoint", 20.0),
    Sketch(N_("CO2"), (("air_co2", "measured"),), "co2_setpoint", 200.0),
    Sketch(N_("Light at the crop"), (("par", "measured"),), "", 200.0),
    Sketch(N_("Lamps"), (), "lamp_on", 100.0, height=100),
    Sketch(N_("Irrigation"), (), "irrigation_on", 100.0, height=100),
    Sketch(N_("Temperature outside"), (("outdoor_temperature", "measured"),), "", 4.0, True),
    Sketch(N_("Sun outside"), (("global_radiation", "measured"),), "", 200.0, True),
    Sketch(N_("Wind"), (("wind_speed", "measured"),), "", 4.0, True),
    Sketch(
        N_("Heating pipes"),
        (("rail_pipe_temperature", "measured"), ("grow_pipe_temperature", "other")),
        "minimum_pipe_setpoint",
        10.0,
        True,
    ),
    Sketch(N_("Vents"), (("vent_lee", "measured"), ("vent_wind", "other")), "", 100.0, True),
    Sketch(N_("Vents open above"), (), "ventilation_setpoint", 4.0, True, height=100),
    Sketch(
        N_("Screens"),
        (("energy_screen", "measured"), ("blackout_screen", "other")),
        "energy_screen_setpoint",
        100.0,
        True,
    ),
)


def panels(
    courses: Mapping[str, Course], state: Mapping[str, Any], site: Site, span: Span, now: float, say: Words
) -> list[Panel]:
    """Return the charts over a span back and the plan ahead; what the site does not measure has none."""
    plan = state.get("plan")
    end = now if plan is None else plan["start"] + plan["step_seconds"] * _steps(plan)
    drawn = []
    for sketch in SKETCHES:
        frame = Frame(now - span.seconds, max(end, now), now, say, sketch.least_span)
        lines = _lines(sketch, courses, plan, span, now, say)
        if not any(len(line.time) for line in lines):
            continue
        name = sketch.measured[0][0] if sketch.measured else sketch.setpoint
        bands, limits = _allowed(sketch, site, frame, span, say)
        stretches = [one for one in binding(plan, sketch.setpoint, site.crop.agronomy, say) if one.end > now]
        summary = describe(sketch, lines, name, span, say)
        sizes = (Size(WIDE, sketch.height), Size(NARROW, sketch.height))
        wide, narrow = (
            Markup(chart(summary, lines, frame, size, bands=bands, limits=limits, stretches=stretches))
            for size in sizes
        )
        legend = _legend(lines, bands, limits, stretches, say)
        drawn.append(Panel(say.text(sketch.title), say.how(name).unit, wide, narrow, legend, sketch.folded))
    return drawn


def _steps(plan: Mapping[str, Any]) -> int:
    return min((len(course) for course in plan["setpoints"].values()), default=0)


def _lines(
    sketch: Sketch,
    courses: Mapping[str, Course],
    plan: Mapping[str, Any] | None,
    span: Span,
    now: float,
    say: Words,
) -> list[Line]:
    gap, asked = 3.0 * span.bucket, say.how(sketch.setpoint)
    lines = []
    if sketch.setpoint in courses:
        past = courses[sketch.setpoint]
        label = say.text("asked of the PLC") if not sketch.measured else say.title(sketch.setpoint)
        lines.append(Line(label, "setpoint", past.time, asked.all(past.mean), stepped=True, gap=gap))
    if plan is not None and sketch.setpoint in plan["setpoints"]:
        time, value = ahead(plan, sketch.setpoint, now, at_end=False)
        lines.append(
            Line(say.text("planned"), "planned", time, asked.all(value), stepped=True, gap=plan["step_seconds"])
        )
    for name, style in sketch.measured:
        how = say.how(name)
        if name in courses:
            past = courses[name]
            label = say.text("measured") if len(sketch.measured) == 1 else say.title(name)
            low, high = (how.all(past.low), how.all(past.high)) if style == "measured" else (None, None)
            lines.append(Line(label, style, past.time, how.all(past.mean), low, high, gap=gap))
        if plan is not None and name in plan["predicted"]:
            time, value = ahead(plan, name, now, at_end=True)
            lines.append(Line(say.text("expected"), "expected", time, how.all(value)))
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


def _allowed(sketch: Sketch, site: Site, frame: Frame, span: Span, say: Words) -> tuple[list[Band], list[Limit]]:
    """Return what the crop and the site allow."""
    crop = site.crop
    if sketch.setpoint == "heating_setpoint":
        how = say.how(sketch.setpoint)
        limits = [
            Limit(say.text(text, limit=say.amount(value, "degC")), how.of(value))
            for text, value in (
                (N_("crop: no colder than {limit}"), crop.temperature_low),
                (N_("crop: no hotter than {limit}"), crop.temperature_high),
            )
        ]
        return ([heating_band(site, frame, say)] if span.seconds <= 86_400 else []), limits
    if "air_humidity" in dict(sketch.measured):
        limit = say.shown("air_humidity", crop.humidity_high)
        return [], [Limit(say.text("crop: no damper than {limit}", limit=limit), crop.humidity_high)]
    if sketch.setpoint == "co2_setpoint":
        rule = site.limits.co2_setpoint
        ends = np.array([frame.start])
        return [Band(say.text("allowed for the setpoint"), ends, np.array([rule.low]), np.array([rule.high]))], []
    return [], []


def heating_band(site: Site, frame: Frame, say: Words) -> Band:
    """Return what the crop allows the heating setpoint, which changes with the sun."""
    place, agronomy, how = Place.of(site), site.crop.agronomy, say.how("heating_setpoint")
    times = np.arange(frame.start, frame.end, BAND_STEP)
    up = [moment(place, time).sun_up for time in times.tolist()]
    changes = [0, *(k for k in range(1, len(up)) if up[k] != up[k - 1])]
    bands = [agronomy.day_temperature if up[k] else agronomy.night_temperature for k in changes]
    low, high = np.array([band.low for band in bands]), np.array([band.high for band in bands])
    label = say.text("allowed for the setpoint, by day and night")
    return Band(label, times[changes], how.all(low), how.all(high))


def _legend(
    lines: list[Line], bands: list[Band], limits: list[Limit], stretches: list[Stretch], say: Words
) -> tuple[tuple[Markup, str], ...]:
    entries = [(f"line {line.style}", line.label) for line in lines if len(line.time)]
    entries += [("band", band.label) for band in bands]
    entries += [("limit", say.text("limit of the crop"))] if limits else []
    if stretches:
        held = "; ".join(dict.fromkeys(one.label for one in stretches))
        entries.append(("binds", say.text("the plan is held by: {limits}", limits=held)))
    return tuple((Markup(swatch(style)), label) for style, label in entries)


def describe(sketch: Sketch, lines: list[Line], name: str, span: Span, say: Words) -> str:
    """Return a chart in one sentence, for those who do not see it."""
    told, how = [], say.how(name)
    for line in lines:
        if len(line.value):
            low, high = (how.back(float(end)) for end in (np.min(line.value), np.max(line.value)))
            ends = say.text("{low} to {high}", low=say.number(name, low), high=say.shown(name, high))
            told.append(f"{line.label} {ends}")
    text = N_("{title}, last {span} and the plan: {lines}")
    return say.text(text, title=say.text(sketch.title), span=say.text(span.title), lines="; ".join(told))
