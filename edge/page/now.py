"""What is now, in words: who decides, what is measured and whether it is as wanted, what the guard held back."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from igrow.core.language import N_
from igrow.core.quantities import CLIMATE, WEATHER
from igrow.core.site import Site
from igrow.edge.notifications.acknowledged import Acknowledgement
from igrow.edge.page.state import Heard
from igrow.edge.page.words import Words
from igrow.edge.planning_schedule import FIRST_PLAN_WAITS

HEADLINES = {
    "override": N_("You decide"),
    "plan": N_("The plan decides"),
    "last_plan": N_("The last plan decides"),
    "recipe": N_("Your recipe decides"),
    "hands_off": N_("The PLC's safe settings rule"),
}
LEVELS = {"critical": N_("critical"), "warning": N_("warning"), "notice": N_("notice")}
"""What an alarm asks, the most first."""
QUALITIES = {
    "frozen": N_("frozen"),
    "missing": N_("missing"),
    "out_of_range": N_("out of range"),
    "spike": N_("spike"),
    "stale": N_("old"),
    "good": N_("good"),
}
COLD = 1.0
"""Kelvin below the heating setpoint from which air counts as too cold: heating swings a little."""
_ROUTINE = re.compile(r"slew of |the crop's temperature_drift|written .* s ago, at least ")


@dataclass(frozen=True)
class Headline:
    """The one line that a grower reads first."""

    tone: str
    """good, warn or bad."""
    mark: str
    text: str
    detail: str


@dataclass(frozen=True)
class Alarm:
    """One alarm that is active."""

    name: str
    level: str
    """One of `LEVELS`."""
    called: str
    """The same in words."""
    text: str
    since: str
    known: str
    """Who knows of it, and since when; empty where nobody does."""


@dataclass(frozen=True)
class Card:
    """One measured quantity."""

    name: str
    title: str
    number: str
    unit: str
    tone: str
    """good, warn, bad, or plain where there is nothing to judge."""
    verdict: str


def headline(heard: Heard, say: Words, now: float = 0.0) -> Headline:
    """Return what matters most. Red while the plant, or the daemon, is not heard."""
    state, text = heard.state, say.text
    last = text("What follows is the last that is known.")
    if heard.silence:
        told = say.told(heard.silence, now)
        nothing = text("Nothing new: {why}", why=told)
        if heard.since is not None and heard.since >= 60.0:
            nothing = text("Nothing new for {time}: {why}", time=say.lasting(heard.since), why=told)
        then = text("The PLC falls back to its own safe settings.")
        detail = f"{say.whole(nothing)} {last} {then}"
        return Headline("bad", "✕", text("The controller is not heard"), detail)
    if state is None:
        detail = text("It has not completed its first cycle yet.")
        return Headline("bad", "✕", text("The controller is not heard"), detail)
    if not state["link_ok"]:
        silent, then = text("The PLC does not answer."), text("The PLC goes on by itself.")
        detail = f"{silent} {last} {then}"
        return Headline("bad", "✕", text("The plant is not heard"), detail)
    worst = sorted((alarm["level"] for alarm in state["alarms"]), key=list(LEVELS).index)
    if worst and worst[0] == "critical":
        return Headline("bad", "✕", text("Go and look now"), text("An alarm is critical."))
    if "warning" in worst or problems(state, say, now):
        return Headline("warn", "!", text("Running, with something to look at"), "")
    return Headline("good", "✓", text("All is well"), "")


def problems(state: Mapping[str, Any], say: Words, now: float) -> list[str]:
    """Return what does not work as it should beside the alarms; a plan that only waits for its log is none."""
    found = [say.sentence(problem, now) for problem in state["problems"] if not problem.startswith(FIRST_PLAN_WAITS)]
    clock = say.text("The date cannot be trusted: plans and updates wait until it can.")
    return found if state["clock_ok"] else [*found, clock]


def waiting(state: Mapping[str, Any], say: Words, now: float) -> str:
    """Return what the first plan waits for; empty where it does not."""
    waits = [problem for problem in state["problems"] if problem.startswith(FIRST_PLAN_WAITS)]
    return say.sentence(waits[0], now) if waits else ""


def decides(state: Mapping[str, Any], now: float, say: Words) -> tuple[str, str]:
    """Return who decides, and why."""
    source = str(state["source"])
    who = say.text(HEADLINES[source]) if source in HEADLINES else say.title(source)
    return who, say.sentence(state["why"], now)


def alarms(state: Mapping[str, Any], known: Mapping[str, Acknowledgement], now: float, say: Words) -> list[Alarm]:
    """Return the active alarms, the worst first."""
    found = []
    for alarm in sorted(state["alarms"], key=lambda one: list(LEVELS).index(one["level"])):
        knows = known.get(alarm["name"])
        found.append(
            Alarm(
                alarm["name"], alarm["level"], say.text(LEVELS[alarm["level"]]), say.sentence(alarm["text"], now),
                "" if alarm["time"] is None else say.when(alarm["time"], now),
                "" if knows is None
                else say.text("known to {who} since {time}", who=knows.by, time=say.when(knows.time, now)),
            )
        )  # fmt: skip
    return found


def cards(state: Mapping[str, Any], site: Site, say: Words, now: float, *, old: bool = False) -> list[Card]:
    """Return the climate, and the weather that drives it, each with whether it is as wanted.

    Of `old` values nothing is judged: the plant, or the daemon, is not heard.
    """
    found = []
    for name in (*CLIMATE, "outdoor_temperature", "global_radiation"):
        value = state["values"].get(name)
        if value is not None:
            known = "warn", "! " + say.text("the last that is known")
            tone, verdict = known if old else judge(name, value, state, site, say, now)
            number = say.number(name, value["value"])
            found.append(Card(name, say.title(name), number, say.how(name).unit, tone, verdict))
    return found


def judge(
    name: str, value: Mapping[str, Any], state: Mapping[str, Any], site: Site, say: Words, now: float
) -> tuple[str, str]:
    """Return tone and words on one measured value: against its setpoint and what the crop bears."""
    if value["quality"] != "good" or value["value"] is None:
        return "warn", f"! {quality(value, say, now)}"
    measured, crop = float(value["value"]), site.crop
    if name == "air_temperature":
        return _air(measured, _standing(state, "heating_setpoint"), site, say)
    if name == "air_humidity":
        limit = say.shown(name, crop.humidity_high)
        if measured > crop.humidity_high:
            return "warn", "▲ " + say.text("damper than the {limit} the crop bears", limit=limit)
        return "good", "✓ " + say.text("below {limit}", limit=limit)
    if name == "air_co2":
        wanted = _standing(state, "co2_setpoint")
        if wanted is None:
            return "plain", ""
        short, setpoint = wanted - measured, say.shown(name, wanted)
        if short > 0.1 * wanted:
            below = say.text("{away} below the setpoint of {setpoint}", away=say.shown(name, short), setpoint=setpoint)
            return "plain", f"▼ {below}"
        return "good", "✓ " + say.text("at or above {setpoint}", setpoint=setpoint)
    return "plain", ""


def quality(value: Mapping[str, Any], say: Words, now: float) -> str:
    """Return the quality of a value in words, with its reason."""
    called, reason = value["quality"], value["why"]
    called = say.text(QUALITIES[called]) if called in QUALITIES else say.spoken(called)
    return f"{called}: {say.told(reason, now)}" if reason else called


def _air(measured: float, wanted: float | None, site: Site, say: Words) -> tuple[str, str]:
    low, high = site.crop.temperature_low, site.crop.temperature_high
    if measured < low:
        return "bad", "▼ " + say.text("colder than the {limit} the crop bears", limit=say.amount(low, "degC"))
    if measured > high:
        return "bad", "▲ " + say.text("hotter than the {limit} the crop bears", limit=say.amount(high, "degC"))
    if wanted is None:
        return "plain", ""
    setpoint = say.shown("heating_setpoint", wanted)
    if measured < wanted - COLD:
        away = say.language.amount(wanted - measured, "K", 2)
        return "warn", "▼ " + say.text("{away} below the heating setpoint", away=away)
    if measured > wanted + COLD:
        return "good", "✓ " + say.text("above the heating setpoint of {setpoint}", setpoint=setpoint)
    return "good", "✓ " + say.text("at the heating setpoint of {setpoint}", setpoint=setpoint)


def _standing(state: Mapping[str, Any], setpoint: str) -> float | None:
    shown = state["setpoints"].get(setpoint, {}).get("shown")
    return None if shown is None else float(shown)


@dataclass(frozen=True)
class Held:
    """One request that the guard changed or held back."""

    when: str
    title: str
    asked: str
    applied: str
    reason: str


def held_back(clamps: Sequence[Mapping[str, Any]], now: float, say: Words) -> tuple[list[Held], list[Held]]:
    """Return what the guard held back, newest first: what matters, and apart from it the routine of ramps."""
    kinds: tuple[list[Held], list[Held]] = ([], [])
    for clamp in clamps:
        name, reason = clamp["point"], clamp["reason"]
        kinds[is_routine(reason)].append(
            Held(
                "" if clamp["time"] is None else say.when(clamp["time"], now),
                say.title(name), say.shown(name, clamp["requested"]),
                say.text("nothing") if clamp["applied"] is None else say.shown(name, clamp["applied"]),
                say.sentence(reason, now),
            )
        )  # fmt: skip
    return kinds


def is_routine(reason: str) -> bool:
    """Tell whether a request was only stretched in time: a ramp, or the least time between two writes."""
    return all(_ROUTINE.match(part.strip()) for part in reason.split(";"))


def points(state: Mapping[str, Any], say: Words, now: float) -> list[tuple[str, str, str, str]]:
    """Return every point: title, value, quality with its reason, age."""
    return [
        (
            say.title(name), say.shown(name, value["value"]), quality(value, say, now),
            "" if value["age"] is None else say.lasting(value["age"]),
        )
        for name, value in sorted(state["values"].items(), key=lambda item: item[0] not in (*CLIMATE, *WEATHER))
    ]  # fmt: skip
