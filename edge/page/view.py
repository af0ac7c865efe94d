"""Everything that the page shows, put together from what was read: what the templates know by name."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import tzinfo
from typing import Any

import numpy as np
from markupsafe import Markup

from igrow.core.quantities import QUANTITIES
from igrow.core.telemetry import Telemetry, from_rows
from igrow.edge.configuration import Configuration
from igrow.edge.notifications.acknowledged import Acknowledgement
from igrow.edge.page import money, now, panels, plan, setpoints, svg, words
from igrow.edge.page.actions import HOURS
from igrow.edge.page.history import SPANS, Course
from igrow.edge.page.state import Heard
from igrow.edge.sources.override import Lease
from igrow.edge.sources.recipe import recipe_course

_log = logging.getLogger("igrow.edge.page")
NOTHING_PLANNED: Mapping[str, Any] = {"panels": [], "area": "", "spent": [], "plan": None}


@dataclass(frozen=True)
class Known:
    """What was read for one visitor."""

    configuration: Configuration
    heard: Heard
    time: float
    """The site's time where the daemon knows it, else this machine's; seconds since 1970 UTC."""
    span: str = "day"
    courses: Mapping[str, Course] = field(default_factory=dict)
    """Of the span."""
    day: Mapping[str, Course] = field(default_factory=dict)
    """Of the last 24 hours."""
    log_problem: str = ""
    leases: Mapping[str, Lease] = field(default_factory=dict)
    acknowledged: Mapping[str, Acknowledgement] = field(default_factory=dict)
    has_password: bool = False


def compose(known: Known) -> dict[str, Any]:
    """Return what the page's template shows."""
    configuration, state, zone = known.configuration, known.heard.state, known.configuration.zone
    site = configuration.site
    headline = now.headline(known.heard)
    shown: dict[str, Any] = {
        "site": state["site"] if state else site.name,
        "headline": headline,
        "clock": words.local(known.time, zone, "%A %d %B %Y, %H:%M"),
        "zone": site.time_zone,
        "has_password": known.has_password,
        "spans": [(name, span.title, name == known.span) for name, span in SPANS.items()],
        "log_problem": known.log_problem,
        "state": state is not None,
    }
    if state is None:
        return shown
    state = {**state, "plan": plan.sound(state["plan"])}
    present = _present(known, state, zone)
    try:
        return shown | present | _planned(known, state, zone)
    except Exception:
        # A fault of ours in what a plan says must not keep alarms and measurements from being seen.
        _log.exception("the plan cannot be shown")
        problem = "Course and plan cannot be shown, by a fault of the page; the journal says more."
        return shown | present | dict(NOTHING_PLANNED) | {"log_problem": problem}


def _present(known: Known, state: Mapping[str, Any], zone: tzinfo) -> dict[str, Any]:
    site, time = known.configuration.site, known.time
    who, why = now.decides(state, time, zone)
    unheard = bool(known.heard.silence) or not state["link_ok"]
    matters, routine = now.held_back(state["clamps"], time, zone)
    cards = [
        (
            card,
            Markup(svg.spark(known.day[card.name].time, known.day[card.name].mean)) if card.name in known.day else "",
        )
        for card in now.cards(state, site, old=unheard)
    ]
    return {
        "who": "" if unheard else who,
        "why": why,
        "recipe_until": setpoints.recipe_lease(known.leases, time, zone),
        "alarms": now.alarms(state, known.acknowledged, time, zone),
        "problems": now.problems(state),
        "waiting": now.waiting(state),
        "cards": cards,
        "setpoints": setpoints.setpoints(state, known.leases, site, time, zone),
        "ends": [(hours, f"{hours} h, until {words.when(time + 3600 * hours, time, zone)}") for hours in HOURS],
        "held": matters,
        "routine": routine,
        "points": now.points(state),
        "cycle": f"{state['cycle']:,}",
        "model": model(state["bundle"], time, zone),
    }


def _planned(known: Known, state: Mapping[str, Any], zone: tzinfo) -> dict[str, Any]:
    configuration, time, made = known.configuration, known.time, state["plan"]
    site = configuration.site
    area = site.greenhouse.floor_area
    shown: dict[str, Any] = {
        "panels": panels.panels(known.courses, state, site, SPANS[known.span], time, zone),
        "area": f"{area:,.4g}",
        "spent": _spent(known, zone),
        "plan": None,
    }
    if made is None:
        return shown
    steps = min(len(course) for course in made["setpoints"].values())
    recipe = recipe_course(configuration.file.recipe, configuration.zone, made["start"], made["step_seconds"], steps)
    blocks = plan.blocks(made, recipe, area, site.crop.agronomy)
    rows = [
        (block, f"{words.when(block.start, time, zone)} to {words.when(block.end, block.start, zone)}")
        for block in blocks
        if block.end > time
    ]
    return shown | {
        "plan": made,
        "time": time,
        "blocks": [
            (words.title(name), [row for row in rows if row[0].setpoint == name])
            for name in dict.fromkeys(block.setpoint for block, _ in rows)
        ],
        "plan_begins": words.when(made["start"], time, zone),
        "plan_ends": words.when(made["valid_until"], time, zone),
        "plan_over": made["valid_until"] <= time,
        "hours": round(steps * made["step_seconds"] / 3600.0),
        "money": money.expected(made, area),
        "plan_note": words.sentence(made.get("note") or ""),
        "plan_problem": words.sentence(made.get("problem") or ""),
    }


def _spent(known: Known, zone: tzinfo) -> list[tuple[str, str]]:
    """Return what today has cost so far, by kind; empty where the log says nothing."""
    log = as_log(known.day)
    if not len(log):
        return []
    found = money.spent(known.configuration.site, log, known.time, zone)
    if not found.hours or not np.isfinite(found.total):
        return []
    titles = dict(money.ROWS)
    rows = [(titles[name], words.euro(cost)) for name, cost in found.costs.items()]
    return [*rows, ("Together", words.euro(found.total))]


def as_log(courses: Mapping[str, Course]) -> Telemetry:
    """Return the means of courses as a log."""
    known = {name: course for name, course in courses.items() if name in QUANTITIES}
    times = np.unique(np.concatenate([course.time for course in known.values()] or [np.empty(0)])).astype(np.int64)
    columns = {}
    for name, course in known.items():
        column = np.full(len(times), np.nan)
        column[np.searchsorted(times, course.time.astype(np.int64))] = course.mean
        columns[name] = column
    return from_rows(times.astype("datetime64[s]"), columns)


def model(bundle: Mapping[str, Any], time: float, zone: tzinfo) -> dict[str, Any]:
    """Return what is known of the simulator that plans are made with."""
    said = []
    for key, text in (
        ("shadow_until", "{} predicts in its shadow until {}."),
        ("probation_until", "{} is on probation until {}."),
    ):
        until, who = bundle.get(key), bundle.get("candidate" if key == "shadow_until" else "name")
        if isinstance(until, int | float) and who:
            said.append(text.format(who, words.when(until, time, zone)))
    said += [words.sentence(str(bundle[key])) for key in ("last_verdict", "refusal") if bundle.get(key)]
    live = bundle.get("live_errors") or {}
    errors = [
        (words.title(name), *(_error(live.get(f"{name} {ahead}"), name) for ahead in ("1_h", "24_h")))
        for name in dict.fromkeys(str(key).split(" ")[0] for key in live)
    ]
    effects = ", ".join(str(effect).replace("_", " ") for effect in bundle.get("effects") or ())
    return {"name": bundle.get("name"), "effects": effects, "said": said, "errors": errors}


def _error(value: float | None, name: str) -> str:
    return "–" if value is None else f"{value:.2g} {words.unit(name)}"
