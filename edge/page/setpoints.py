"""The setpoints in words: where each stands, who decides on it and why, what comes, and who has taken it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import tzinfo
from typing import Any

from igrow.core.quantities import QUANTITIES, SETPOINTS
from igrow.core.site import Site
from igrow.edge.page import words
from igrow.edge.page.plan import next_change
from igrow.edge.sources.override import RECIPE, Lease


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
    low: str
    high: str
    step: str
    unit: str
    value: str


def setpoints(
    state: Mapping[str, Any], leases: Mapping[str, Lease], site: Site, now: float, zone: tzinfo
) -> list[Setpoint]:
    """Return the setpoints that sources decide on."""
    found = []
    for name, one in state["setpoints"].items():
        if name not in SETPOINTS:
            continue
        limits, factor = getattr(site.limits, name), words.scale(name)
        asked, shown = one["requested"], one["shown"]
        away = asked is not None and shown is not None and words.number(name, asked) != words.number(name, shown)
        reason = reason_of(one["source"], words.in_local_time(one["why"], now, zone))
        decider = one["source"]
        if one["held_until"] is not None:
            decider = "hand"
            left = words.lasting(one["held_until"] - state["monotonic"])
            reason = f"respected for {left} more"
        found.append(
            Setpoint(
                name, words.title(name), words.shown(name, shown),
                f"on its way to {words.shown(name, asked)}" if away else "",
                words.DECIDERS.get(decider, decider), reason,
                next_change(state["plan"], name, now, zone) if one["source"] in ("plan", "last_plan") else "",
                lease_words(leases.get(name), now, zone),
                f"{limits.low * factor:g}", f"{limits.high * factor:g}",
                "5" if factor > 1 else "10" if QUANTITIES[name].unit == "ppm" else "0.1",
                words.unit(name), "" if shown is None else words.number(name, shown),
            )
        )  # fmt: skip
    return found


def reason_of(source: str, why: str) -> str:
    """Return what a source says of itself, without what "The plan", "Your recipe" or "You" beside it says already."""
    if source == "override" or why == "the recipe":
        return ""
    for known in ("the plan ", "the last valid plan, ", "the recipe, "):
        why = why.removeprefix(known)
    return why


def lease_words(lease: Lease | None, now: float, zone: tzinfo) -> str:
    """Return who has taken something until when; nothing where the lease is over."""
    if lease is None or (lease.until is not None and lease.until <= now):
        return ""
    end = (
        f"for {words.lasting(lease.seconds)}" if lease.until is None else f"until {words.when(lease.until, now, zone)}"
    )
    return f"{end}, by {lease.by}" if lease.by else end


def recipe_lease(leases: Mapping[str, Lease], now: float, zone: tzinfo) -> str:
    """Return until when the grower wants the recipe, and who said so; nothing where plans may rule."""
    return lease_words(leases.get(RECIPE), now, zone)
