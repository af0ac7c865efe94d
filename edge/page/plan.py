"""The plan in words: which stretches it has, how they differ from the recipe, and what each is for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import tzinfo
from typing import Any

import numpy as np

from igrow.core.agronomy.limits import Agronomy
from igrow.core.planner.explain import PARTS, SAME, Amount, Change, limits_in_force
from igrow.core.quantities import SETPOINTS
from igrow.edge.page import words
from igrow.edge.page.svg import Stretch

MORE = {
    "heating_setpoint": ("Warmer", "Cooler"),
    "co2_setpoint": ("More CO₂", "Less CO₂"),
    "lamp_on": ("More lamp light", "Less lamp light"),
    "irrigation_on": ("More water", "Less water"),
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
    plan: Mapping[str, Any], recipe: Mapping[str, Sequence[float]], area: float, limits: Agronomy
) -> list[Block]:
    """Return the stretches of a plan, by setpoint and time.

    Args:
        plan: as the daemon's JSON holds it.
        recipe: what the grower's recipe would ask over the plan's steps, by setpoint.
        area: growing area in m2, by which money is for the whole greenhouse.
        limits: of the crop.
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
                    name, start, end, span(name, values[rows]), side[first] == 0.0,
                    why(name, float(side[first]), span(name, usual[rows]), change, area, explained=bool(explained)),
                    tuple(limit_words(limit, limits) for limit in named),
                )
            )  # fmt: skip
    return found


def span(name: str, values: np.ndarray[Any, Any]) -> str:
    """Return one value, or the least and the greatest, with their unit."""
    low, high = words.number(name, float(values.min())), words.number(name, float(values.max()))
    return words.shown(name, float(values[0])) if low == high else f"{low} to {high} {words.unit(name)}"


def why(name: str, side: float, usual: str, change: Change | None, area: float, *, explained: bool) -> str:
    """Return one sentence on a stretch: how it differs from the recipe, and what that is for."""
    if side == 0.0:
        return "As your recipe." if explained else "As your recipe, or close to it."
    differs = f"{MORE[name][0 if side > 0 else 1]} than your recipe ({usual})"
    if change is None:
        return f"{differs}: a small change, not among those that matter most." if explained else f"{differs}."
    told = [part(kind, change.parts[kind] * area) for kind in PARTS]
    gain = change.gain.mean * area
    low, high = (bound * area for bound in change.gain.interval)
    total = f"together {words.euro(gain, sign=True)}"
    if abs(high - low) >= 2 * TOLD:
        total += f", between {words.euro(low, sign=True)} and {words.euro(high, sign=True)}"
    reasons = "; ".join(filter(None, told)) or "it changes next to nothing in money"
    return f"{differs}: {reasons}; {total}."


def part(kind: str, amount: float) -> str:
    """Return what a change adds to growth or to a cost, EUR for the greenhouse; empty where it is next to none."""
    if abs(amount) < TOLD:
        return ""
    size = words.euro(abs(amount))
    if kind == "income":
        return f"growth worth {size} {'more' if amount > 0 else 'less'}"
    cost = {"heat": "heat", "electricity": "electricity", "co2": "CO₂"}[kind]
    return f"{size} {'more' if amount > 0 else 'less'} for {cost}"


def limit_words(limit: str, limits: Agronomy) -> str:
    """Return a limit of the crop in words, with its value in the site's file."""
    bands = {
        "day_temperature": ("temperature by day", limits.day_temperature),
        "night_temperature": ("temperature at night", limits.night_temperature),
        "mean_temperature": ("mean temperature of a day", limits.mean_temperature),
    }
    if limit in bands:
        text, band = bands[limit]
        return f"{text}, {band.low:g} to {band.high:g} °C"
    values = {
        "temperature_difference": f"at most {limits.temperature_difference:g} K within a day",
        "temperature_drift": f"at most {limits.temperature_drift:g} K an hour",
        "dark_hours": f"{limits.dark_hours:g} dark hours a night",
        "light_sum": f"at most {limits.light_sum_high:g} mol/m² of light a day",
        "light_sum_high": f"at most {limits.light_sum_high:g} mol/m² of light a day",
        "co2_with_people": f"at most {limits.co2_with_people:g} ppm while people are inside",
        "rest": "least times between switching",
    }
    return values.get(limit, limit.replace("_", " "))


def binding(plan: Mapping[str, Any] | None, setpoint: str, limits: Agronomy) -> list[Stretch]:
    """Return when a limit of the crop stands in the way of a setpoint's plan."""
    if plan is None:
        return []
    return [
        Stretch(
            limit_words(limit, limits),
            plan["start"] + first * plan["step_seconds"],
            plan["start"] + (last + 1) * plan["step_seconds"],
        )
        for name, limit, first, last in limits_in_force(plan.get("binding") or {})
        if name == setpoint
    ]


def next_change(plan: Mapping[str, Any] | None, name: str, now: float, zone: tzinfo) -> str:
    """Return what the plan asks for next of a setpoint, and when; nothing where it stays as it is."""
    if plan is None or name not in plan["setpoints"]:
        return ""
    course, step = plan["setpoints"][name], plan["step_seconds"]
    present = int((now - plan["start"]) // step)
    if not 0 <= present < len(course):
        return ""
    for number in range(present + 1, len(course)):
        if abs(course[number] - course[present]) > SAME[name]:
            return f"{words.shown(name, course[number])} from {words.when(plan['start'] + number * step, now, zone)}"
    return ""
