"""The setpoints in words: where each stands, who decides on it and why, what comes, and who has taken it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from igrow.core.language import N_
from igrow.core.quantities import QUANTITIES, SETPOINTS
from igrow.core.site import Site
from igrow.edge.page.plan import next_change
from igrow.edge.page.words import DECIDERS, DIGITS, Words
from igrow.edge.sources.override import RECIPE, Lease

SHORTER = {
    "the plan ": N_("of {0}"),
    "the last valid plan, ": N_("of {0}, until {1}"),
    "the recipe, ": N_("wanted by the grower for {0} min more"),
}
"""What stands beside it already -> the texts that are left."""


@dataclass(frozen=True)
class Setpoint:
    """One setpoint: where it stands, who decides on it, what comes."""

    name: str
    title: str
    shown: str
    wanted: str
    """What is asked for, where the PLC does not show it yet."""
    decider: str
    why: str
    next: str
    lease: str
    """Until when somebody has taken it; empty where nobody has."""
    range: str
    """What may be asked for, with its unit, in words."""
    low: str
    """As a form's field takes it, as the following are."""
    high: str
    step: str
    value: str


def setpoints(
    state: Mapping[str, Any], leases: Mapping[str, Lease], site: Site, now: float, say: Words
) -> list[Setpoint]:
    """Return the setpoints that sources decide on."""
    found = []
    for name, one in state["setpoints"].items():
        if name not in SETPOINTS:
            continue
        limits, how = getattr(site.limits, name), say.how(name)
        low, high = how.of(limits.low), how.of(limits.high)
        asked, shown = one["requested"], one["shown"]
        away = asked is not None and shown is not None and say.number(name, asked) != say.number(name, shown)
        reason = say.told(reason_of(one["source"], one["why"]), now)
        decider = one["source"]
        if one["held_until"] is not None:
            decider = "hand"
            left = say.lasting(one["held_until"] - state["monotonic"])
            reason = say.text("respected for {time} more", time=left)
        found.append(
            Setpoint(
                name, say.title(name), say.shown(name, shown),
                say.text("on its way to {value}", value=say.shown(name, asked)) if away else "",
                say.text(DECIDERS.get(decider, decider)), reason,
                next_change(state["plan"], name, now, say) if one["source"] in ("plan", "last_plan") else "",
                lease_words(leases.get(name), now, say),
                say.text("{low} to {high}", low=say.number(name, limits.low), high=say.shown(name, limits.high)),
                f"{low:.6g}", f"{high:.6g}",
                {"1": "5", "%": "1", "ppm": "10"}.get(QUANTITIES[name].unit, "0.1"),
                "" if shown is None else f"{how.of(shown):.{DIGITS.get(QUANTITIES[name].unit, 1)}f}",
            )
        )  # fmt: skip
    return found


def reason_of(source: str, why: str) -> str:
    """Return what a source says of itself, without what "The plan", "Your recipe" or "You" beside it says already."""
    if source == "override" or why == "the recipe":
        return ""
    for known in SHORTER:
        why = why.removeprefix(known)
    return why


def lease_words(lease: Lease | None, now: float, say: Words) -> str:
    """Return who has taken something until when; nothing where the lease is over."""
    if lease is None or (lease.until is not None and lease.until <= now):
        return ""
    end = (
        say.text("for {time}", time=say.lasting(lease.seconds))
        if lease.until is None
        else say.text("until {time}", time=say.when(lease.until, now))
    )
    return say.text("{end}, by {who}", end=end, who=lease.by) if lease.by else end


def recipe_lease(leases: Mapping[str, Lease], now: float, say: Words) -> str:
    """Return until when the grower wants the recipe, and who said so; nothing where plans may rule."""
    return lease_words(leases.get(RECIPE), now, say)
