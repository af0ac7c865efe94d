"""What is now, in words: who decides, what is measured and whether it is as wanted, what the guard held back."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import tzinfo
from typing import Any

from igrow.core.quantities import CLIMATE, WEATHER
from igrow.core.site import Site
from igrow.edge.notifications.acknowledged import Acknowledgement
from igrow.edge.page import words
from igrow.edge.page.state import Heard
from igrow.edge.planning_schedule import FIRST_PLAN_WAITS

HEADLINES = {
    "override": "You decide",
    "plan": "The plan decides",
    "last_plan": "The last plan decides",
    "recipe": "Your recipe decides",
    "hands_off": "The PLC's safe settings rule",
}
LEVELS = ("critical", "warning", "notice")
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


def headline(heard: Heard) -> Headline:
    """Return what matters most. Red while the plant, or the daemon, is not heard."""
    state = heard.state
    if heard.silence:
        since = f" for {words.lasting(heard.since)}" if heard.since is not None and heard.since >= 60.0 else ""
        then = "What follows is the last that is known. The PLC falls back to its own safe settings."
        return Headline("bad", "✕", "The controller is not heard", f"Nothing new{since}: {heard.silence}. {then}")
    if state is None:
        return Headline("bad", "✕", "The controller is not heard", "It has not completed its first cycle yet.")
    if not state["link_ok"]:
        then = "What follows is the last that is known. The PLC goes on by itself."
        return Headline("bad", "✕", "The plant is not heard", f"The PLC does not answer. {then}")
    worst = sorted((alarm["level"] for alarm in state["alarms"]), key=LEVELS.index)
    if worst and worst[0] == "critical":
        return Headline("bad", "✕", "Go and look now", "An alarm is critical.")
    if "warning" in worst or problems(state):
        return Headline("warn", "!", "Running, with something to look at", "")
    return Headline("good", "✓", "All is well", "")


def problems(state: Mapping[str, Any]) -> list[str]:
    """Return what does not work as it should beside the alarms; a plan that only waits for its log is none."""
    found = [words.sentence(problem) for problem in state["problems"] if not problem.startswith(FIRST_PLAN_WAITS)]
    clock = "The date cannot be trusted: plans and updates wait until it can."
    return found if state["clock_ok"] else [*found, clock]


def waiting(state: Mapping[str, Any]) -> str:
    """Return what the first plan waits for; empty where it does not."""
    waits = [problem for problem in state["problems"] if problem.startswith(FIRST_PLAN_WAITS)]
    return words.sentence(waits[0]) if waits else ""


def decides(state: Mapping[str, Any], now: float, zone: tzinfo) -> tuple[str, str]:
    """Return who decides, and why."""
    who = HEADLINES.get(state["source"], words.sentence(str(state["source"]).replace("_", " ")).rstrip("."))
    return who, words.sentence(words.in_local_time(state["why"], now, zone))


def alarms(state: Mapping[str, Any], known: Mapping[str, Acknowledgement], now: float, zone: tzinfo) -> list[Alarm]:
    """Return the active alarms, the worst first."""
    found = []
    for alarm in sorted(state["alarms"], key=lambda one: LEVELS.index(one["level"])):
        knows = known.get(alarm["name"])
        found.append(
            Alarm(
                alarm["name"], alarm["level"], words.sentence(alarm["text"]),
                "" if alarm["time"] is None else words.when(alarm["time"], now, zone),
                "" if knows is None else f"known to {knows.by} since {words.when(knows.time, now, zone)}",
            )
        )  # fmt: skip
    return found


def cards(state: Mapping[str, Any], site: Site, *, old: bool = False) -> list[Card]:
    """Return the climate, and the weather that drives it, each with whether it is as wanted.

    Of `old` values nothing is judged: the plant, or the daemon, is not heard.
    """
    found = []
    for name in (*CLIMATE, "outdoor_temperature", "global_radiation"):
        value = state["values"].get(name)
        if value is not None:
            tone, verdict = ("warn", "! the last that is known") if old else judge(name, value, state, site)
            number = words.number(name, value["value"])
            found.append(Card(name, words.title(name), number, words.unit(name), tone, verdict))
    return found


def judge(name: str, value: Mapping[str, Any], state: Mapping[str, Any], site: Site) -> tuple[str, str]:
    """Return tone and words on one measured value: against its setpoint and what the crop bears."""
    if value["quality"] != "good" or value["value"] is None:
        return "warn", f"! {value['quality'].replace('_', ' ')}: {value['why']}".rstrip(": ")
    measured, crop = float(value["value"]), site.crop
    if name == "air_temperature":
        return _air(measured, _standing(state, "heating_setpoint"), site)
    if name == "air_humidity":
        limit = words.shown(name, crop.humidity_high)
        damp = measured > crop.humidity_high
        return ("warn", f"▲ damper than the {limit} the crop bears") if damp else ("good", f"✓ below {limit}")
    if name == "air_co2":
        wanted = _standing(state, "co2_setpoint")
        if wanted is None:
            return "plain", ""
        short = wanted - measured
        text = words.shown(name, wanted)
        return (
            ("plain", f"▼ {short:.0f} below the setpoint of {text}")
            if short > 0.1 * wanted
            else ("good", f"✓ at or above {text}")
        )
    return "plain", ""


def _air(measured: float, wanted: float | None, site: Site) -> tuple[str, str]:
    crop = site.crop
    if measured < crop.temperature_low:
        return "bad", f"▼ colder than the {crop.temperature_low:g} °C the crop bears"
    if measured > crop.temperature_high:
        return "bad", f"▲ hotter than the {crop.temperature_high:g} °C the crop bears"
    if wanted is None:
        return "plain", ""
    if measured < wanted - COLD:
        return "warn", f"▼ {wanted - measured:.1f} K below the heating setpoint"
    if measured > wanted + COLD:
        return "good", f"✓ above the heating setpoint of {wanted:.1f} °C"
    return "good", f"✓ at the heating setpoint of {wanted:.1f} °C"


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


def held_back(clamps: Sequence[Mapping[str, Any]], now: float, zone: tzinfo) -> tuple[list[Held], list[Held]]:
    """Return what the guard held back, newest first: what matters, and apart from it the routine of ramps."""
    kinds: tuple[list[Held], list[Held]] = ([], [])
    for clamp in clamps:
        name, reason = clamp["point"], clamp["reason"]
        kinds[is_routine(reason)].append(
            Held(
                "" if clamp["time"] is None else words.when(clamp["time"], now, zone),
                words.title(name), words.shown(name, clamp["requested"]),
                "nothing" if clamp["applied"] is None else words.shown(name, clamp["applied"]),
                words.sentence(words.in_local_time(reason, now, zone)),
            )
        )  # fmt: skip
    return kinds


def is_routine(reason: str) -> bool:
    """Tell whether a request was only stretched in time: a ramp, or the least time between two writes."""
    return all(_ROUTINE.match(part.strip()) for part in reason.split(";"))


def points(state: Mapping[str, Any]) -> list[tuple[str, str, str, str]]:
    """Return every point: title, value, quality with its reason, age."""
    return [
        (
            words.title(name), words.shown(name, value["value"]),
            " ".join(filter(None, (value["quality"].replace("_", " "), value["why"]))),
            "" if value["age"] is None else words.lasting(value["age"]),
        )
        for name, value in sorted(state["values"].items(), key=lambda item: item[0] not in (*CLIMATE, *WEATHER))
    ]  # fmt: skip
