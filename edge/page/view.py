"""Everything that the page shows, put together from what was read: what the templates know by name."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from markupsafe import Markup

from igrow.core.co2_count import CO2Count
from igrow.core.language import ENGLISH, N_
from igrow.core.quantities import QUANTITIES
from igrow.core.telemetry import Telemetry, from_rows
from igrow.edge.configuration import Configuration
from igrow.edge.notifications.acknowledged import Acknowledgement
from igrow.edge.page import money, now, panels, plan, separating_tests, setpoints, svg
from igrow.edge.page.actions import HOURS
from igrow.edge.page.history import SPANS, Course
from igrow.edge.page.state import Heard
from igrow.edge.page.words import Words
from igrow.edge.separating_tests import Approval
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
    language: str = ENGLISH.code
    """The visitor's."""
    approval: Approval | None = None
    """Of a separating test, the last one."""


def compose(known: Known) -> dict[str, Any]:
    """Return what the page's template shows."""
    configuration, state = known.configuration, known.heard.state
    site = configuration.site
    say = Words.of(site, known.language)
    headline = now.headline(known.heard, say, known.time)
    shown: dict[str, Any] = {
        "site": state["site"] if state else site.name,
        "headline": headline,
        "clock": f"{say.date(known.time, 'full')}, {say.local(known.time):%H:%M}",
        **said_by(say),
        "zone": site.time_zone,
        "has_password": known.has_password,
        "spans": [(name, say.text(span.title), name == known.span) for name, span in SPANS.items()],
        "log_problem": say.sentence(known.log_problem, known.time),
        "state": state is not None,
    }
    if state is None:
        return shown
    state = {**state, "plan": plan.sound(state["plan"])}
    present = _present(known, state, say)
    try:
        return shown | present | _planned(known, state, say)
    except Exception:
        # A fault of ours in what a plan says must not keep alarms and measurements from being seen.
        _log.exception("the plan cannot be shown")
        problem = say.text("Course and plan cannot be shown, by a fault of the page; the journal says more.")
        return shown | present | dict(NOTHING_PLANNED) | {"log_problem": problem}


def said_by(say: Words) -> dict[str, Any]:
    """Return what every template needs to speak a language."""
    return {"_": say.text, "language": say.language.code}


def _present(known: Known, state: Mapping[str, Any], say: Words) -> dict[str, Any]:
    site, time = known.configuration.site, known.time
    who, why = now.decides(state, time, say)
    unheard = bool(known.heard.silence) or not state["link_ok"]
    matters, routine = now.held_back(state["clamps"], time, say)
    cards = [
        (
            card,
            Markup(svg.spark(known.day[card.name].time, known.day[card.name].mean)) if card.name in known.day else "",
        )
        for card in now.cards(state, site, say, time, old=unheard)
    ]
    return {
        "who": "" if unheard else who,
        "why": why,
        "recipe_until": setpoints.recipe_lease(known.leases, time, say),
        "alarms": now.alarms(state, known.acknowledged, time, say),
        "problems": now.problems(state, say, time),
        "waiting": now.waiting(state, say, time),
        "cards": cards,
        "setpoints": setpoints.setpoints(state, known.leases, site, time, say),
        "ends": [
            (hours, say.text("{hours} h, until {time}", hours=hours, time=say.when(time + 3600 * hours, time)))
            for hours in HOURS
        ],
        "tests": separating_tests.panel(known.configuration, state, known.approval, say, time),
        "held": matters,
        "routine": routine,
        "points": now.points(state, say, time),
        "cycle": say.language.fixed(state["cycle"], 0),
        "model": model(state["bundle"], time, say),
    }


def _planned(known: Known, state: Mapping[str, Any], say: Words) -> dict[str, Any]:
    configuration, time, made = known.configuration, known.time, state["plan"]
    site = configuration.site
    area = site.greenhouse.floor_area
    shown: dict[str, Any] = {
        "panels": panels.panels(known.courses, state, site, SPANS[known.span], time, say),
        "area": say.language.amount(area, "m2", 4),
        "spent": _spent(known, made, say),
        "plan": None,
    }
    if made is None:
        return shown
    steps = min(len(course) for course in made["setpoints"].values())
    recipe = recipe_course(configuration.file.recipe, configuration.zone, made["start"], made["step_seconds"], steps)
    blocks = plan.blocks(made, recipe, area, site.crop.agronomy, say)
    rows = [
        (block, say.text("{low} to {high}", low=say.when(block.start, time), high=say.when(block.end, block.start)))
        for block in blocks
        if block.end > time
    ]
    return shown | {
        "plan": made,
        "time": time,
        "blocks": [
            (say.title(name), [row for row in rows if row[0].setpoint == name])
            for name in dict.fromkeys(block.setpoint for block, _ in rows)
        ],
        "plan_begins": say.when(made["start"], time),
        "plan_ends": say.when(made["valid_until"], time),
        "plan_over": made["valid_until"] <= time,
        "hours": round(steps * made["step_seconds"] / 3600.0),
        "money": money.expected(made, area, say),
        "plan_note": say.sentence(made.get("note") or "", time),
        "plan_problem": say.sentence(made.get("problem") or "", time),
    }


def _spent(known: Known, made: Mapping[str, Any] | None, say: Words) -> list[tuple[str, str]]:
    """Return what today has cost so far, by kind; empty where the log says nothing."""
    log = as_log(known.day)
    if not len(log):
        return []
    had = None if made is None else made.get("co2_before")
    counted = None if made is None or had is None else CO2Count(made["start"], had)
    found = money.spent(known.configuration.site, log, known.time, say.zone, counted)
    if not found.hours or not np.isfinite(found.total):
        return []
    titles = dict(money.ROWS)
    rows = [(say.text(titles[name]), say.euro(cost)) for name, cost in found.costs.items()]
    return [*rows, (say.text("Together"), say.euro(found.total))]


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


def model(bundle: Mapping[str, Any], time: float, say: Words) -> dict[str, Any]:
    """Return what is known of the simulator that plans are made with."""
    said = []
    for key, text in (
        ("shadow_until", N_("{bundle} predicts in its shadow until {time}.")),
        ("probation_until", N_("{bundle} is on probation until {time}.")),
    ):
        until, who = bundle.get(key), bundle.get("candidate" if key == "shadow_until" else "name")
        if isinstance(until, int | float) and who:
            said.append(say.text(text, bundle=who, time=say.when(until, time)))
    said += [say.sentence(str(bundle[key]), time) for key in ("last_verdict", "refusal") if bundle.get(key)]
    live = bundle.get("live_errors") or {}
    errors = [
        (say.title(name), *(_error(live.get(f"{name} {ahead}"), name, say) for ahead in ("1_h", "24_h")))
        for name in dict.fromkeys(str(key).split(" ")[0] for key in live)
    ]
    effects = say.language.listed([say.effect(str(effect)) for effect in bundle.get("effects") or ()])
    return {"name": bundle.get("name"), "effects": effects, "said": said, "errors": errors}


def _error(value: float | None, name: str, say: Words) -> str:
    if value is None:
        return "–"
    # An error is a difference.
    return say.language.amount(value, QUANTITIES[name].difference_unit)
