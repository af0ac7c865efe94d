"""The plan in words: which stretches it has, how they differ from the recipe, and what each is for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from igrow.core.language import N_
from igrow.core.planner.explain import PARTS, SAME, Amount, Change, limits_in_force
from igrow.core.quantities import SETPOINTS
from igrow.core.site import Agronomy
from igrow.edge.page.svg import Stretch
from igrow.edge.page.words import Words

MORE = {
    "heating_setpoint": (N_("Warmer than your recipe ({usual})"), N_("Cooler than your recipe ({usual})")),
    "co2_setpoint": (N_("More CO2 than your recipe ({usual})"), N_("Less CO2 than your recipe ({usual})")),
    "lamp_on": (N_("More lamp light than your recipe ({usual})"), N_("Less lamp light than your recipe ({usual})")),
    "irrigation_on": (N_("More water than your recipe ({usual})"), N_("Less water than your recipe ({usual})")),
    "humidity_setpoint": (
        N_("Damper before vents open than by your recipe ({usual})"),
        N_("Drier before vents open than by your recipe ({usual})"),
    ),
    "ventilation_setpoint": (
        N_("Warmer before vents open than by your recipe ({usual})"),
        N_("Cooler before vents open than by your recipe ({usual})"),
    ),
    "minimum_pipe_setpoint": (
        N_("A warmer minimum pipe than by your recipe ({usual})"),
        N_("A cooler minimum pipe than by your recipe ({usual})"),
    ),
    "energy_screen_setpoint": (
        N_("A screen that may close further than by your recipe ({usual})"),
        N_("A screen that stays further open than by your recipe ({usual})"),
    ),
}
PART_TEXTS = {
    "income": (N_("growth worth {amount} more"), N_("growth worth {amount} less")),
    "heat": (N_("{amount} more for heat"), N_("{amount} less for heat")),
    "electricity": (N_("{amount} more for electricity"), N_("{amount} less for electricity")),
    "co2": (N_("{amount} more for CO2"), N_("{amount} less for CO2")),
}
TOLD = 0.005
"""Amounts of money that would be shown as nothing are not told, EUR."""


@dataclass(frozen=True)
class Block:
    """A stretch of a plan that stands on one side of the recipe, or on it."""

    setpoint: str
    start: float
    """Seconds since 1970 UTC."""
    end: float
    values: str
    """What the plan asks for, such as "17.0 to 19.0 °C"."""
    same: bool
    """As the recipe."""
    why: str
    limits: tuple[str, ...]
    """The crop's limits that stand in the way within it, in words."""


def sound(plan: Mapping[str, Any] | None) -> dict[str, Any] | None:
    """Return a plan as it can be told: without an explanation that holds no numbers; None for setpoints that are none.

    What is not finite comes as None in the daemon's JSON.
    """
    if plan is None or any(value is None for course in plan["setpoints"].values() for value in course):
        return None
    explained = plan.get("explanation")
    return {**plan, "explanation": explained if explained and _whole(explained) else None}


def _whole(plain: object) -> bool:
    """Tell whether all of it is there."""
    if isinstance(plain, Mapping):
        return all(_whole(one) for one in plain.values())
    return all(_whole(one) for one in plain) if isinstance(plain, list) else plain is not None


def change_of(plain: Mapping[str, Any]) -> Change:
    """Return a change as the daemon's JSON holds it."""
    gain = Amount(plain["gain"]["mean"], plain["gain"]["deviation"])
    return Change(plain["setpoint"], plain["start"], plain["end"], plain["plan"], plain["recipe"], plain["parts"], gain)


def blocks(
    plan: Mapping[str, Any], recipe: Mapping[str, Sequence[float]], area: float, limits: Agronomy, say: Words
) -> list[Block]:
    """Return the stretches of a plan, by setpoint and time.

    Args:
        plan: as the daemon's JSON holds it.
        recipe: what the grower's recipe would ask over the plan's steps, by setpoint.
        area: growing area in m2, by which money is for the whole greenhouse.
        limits: of the crop.
        say: the language.
    """
    explained = plan.get("explanation") or {}
    changes = [change_of(change) for change in explained.get("changes", ())]
    bound = list(limits_in_force(plan.get("binding") or {}))
    found = []
    for name in SETPOINTS:
        if name not in plan["setpoints"]:
            continue
        values, usual = np.array(plan["setpoints"][name]), np.array(recipe.get(name, plan["setpoints"][name]))
        away = values - usual
        side = np.where(np.abs(away) > SAME[name], np.sign(away), 0.0)
        for rows in np.split(np.arange(len(side)), np.flatnonzero(np.diff(side)) + 1):
            first, last = int(rows[0]), int(rows[-1])
            start = plan["start"] + first * plan["step_seconds"]
            end = plan["start"] + (last + 1) * plan["step_seconds"]
            change = next((c for c in changes if c.setpoint == name and c.start < end and c.end > start), None)
            named = dict.fromkeys(
                limit for one, limit, low, high in bound if one == name and low <= last and high >= first
            )
            found.append(
                Block(
                    name, start, end, span(name, values[rows], say), side[first] == 0.0,
                    why(name, float(side[first]), usual[rows], change, area, say, explained=bool(explained)),
                    tuple(limit_words(limit, limits, say) for limit in named),
                )
            )  # fmt: skip
    return found


def span(name: str, values: np.ndarray[Any, Any], say: Words) -> str:
    """Return one value, or the least and the greatest, with their unit."""
    low, high = say.number(name, float(values.min())), say.number(name, float(values.max()))
    if low == high:
        return say.shown(name, float(values[0]))
    return say.text("{low} to {high}", low=low, high=say.shown(name, float(values.max())))


def why(
    name: str,
    side: float,
    usual: np.ndarray[Any, Any],
    change: Change | None,
    area: float,
    say: Words,
    *,
    explained: bool,
) -> str:
    """Return one sentence on a stretch: how it differs from the recipe, and what that is for."""
    if side == 0.0:
        return say.text("As your recipe.") if explained else say.text("As your recipe, or close to it.")
    differs = say.text(MORE[name][0 if side > 0 else 1], usual=span(name, usual, say))
    if change is None:
        small = N_("{change}: a small change, not among those that matter most.")
        return say.text(small, change=differs) if explained else say.whole(differs)
    told = [part(kind, change.parts[kind] * area, say) for kind in PARTS]
    gain = change.gain.mean * area
    low, high = (bound * area for bound in change.gain.interval)
    total = say.text("together {amount}", amount=say.euro(gain, sign=True))
    if abs(high - low) >= 2 * TOLD:
        total += say.text(", between {low} and {high}", low=say.euro(low, sign=True), high=say.euro(high, sign=True))
    reasons = "; ".join(filter(None, told)) or say.text("it changes next to nothing in money")
    return say.text("{change}: {reasons}; {total}.", change=differs, reasons=reasons, total=total)


def part(kind: str, amount: float, say: Words) -> str:
    """Return what a change adds to growth or to a cost, EUR for the greenhouse; empty where it is next to none."""
    if abs(amount) < TOLD:
        return ""
    return say.text(PART_TEXTS[kind][0 if amount > 0 else 1], amount=say.euro(abs(amount)))


def limit_words(limit: str, limits: Agronomy, say: Words) -> str:
    """Return a limit of the crop in words, with its value in the site's file."""
    bands = {
        "day_temperature": (N_("temperature by day, {low} to {high}"), limits.day_temperature),
        "night_temperature": (N_("temperature at night, {low} to {high}"), limits.night_temperature),
        "mean_temperature": (N_("mean temperature of a day, {low} to {high}"), limits.mean_temperature),
    }
    if limit in bands:
        text, band = bands[limit]
        low = say.language.number(say.language.shown("degC").of(band.low), 4)
        return say.text(text, low=low, high=say.amount(band.high, "degC"))
    least = (N_("at most {value} of light a day"), limits.light_sum_high, "mol m-2")
    values = {
        "temperature_difference": (N_("at most {value} within a day"), limits.temperature_difference, "K"),
        "temperature_drift": (N_("at most {value} an hour"), limits.temperature_drift, "K"),
        "dark_hours": (N_("{value} dark hours a night"), limits.dark_hours, "1"),
        "light_sum": least,
        "light_sum_high": least,
        "dead_zone": (N_("vents open at least {value} above the heating setpoint"), limits.dead_zone, "K"),
        "co2_with_people": (N_("at most {value} while people are inside"), limits.co2_with_people, "ppm"),
    }
    if limit in values:
        text, value, unit = values[limit]
        return say.text(text, value=say.amount(value, unit))
    return say.text("least times between switching") if limit == "rest" else say.spoken(limit)


def binding(plan: Mapping[str, Any] | None, setpoint: str, limits: Agronomy, say: Words) -> list[Stretch]:
    """Return when a limit of the crop stands in the way of a setpoint's plan."""
    if plan is None:
        return []
    return [
        Stretch(
            limit_words(limit, limits, say),
            plan["start"] + first * plan["step_seconds"],
            plan["start"] + (last + 1) * plan["step_seconds"],
        )
        for name, limit, first, last in limits_in_force(plan.get("binding") or {})
        if name == setpoint
    ]


def next_change(plan: Mapping[str, Any] | None, name: str, now: float, say: Words) -> str:
    """Return what the plan asks for next of a setpoint, and when; nothing where it stays as it is."""
    if plan is None or name not in plan["setpoints"]:
        return ""
    course, step = plan["setpoints"][name], plan["step_seconds"]
    present = int((now - plan["start"]) // step)
    if not 0 <= present < len(course):
        return ""
    for number in range(present + 1, len(course)):
        if abs(course[number] - course[present]) > SAME[name]:
            from_then = say.when(plan["start"] + number * step, now)
            return say.text("{value} from {time}", value=say.shown(name, course[number]), time=from_then)
    return ""
