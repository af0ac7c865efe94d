"""Euros for this greenhouse: what plan and recipe are expected to bring, and what today has cost so far."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, tzinfo
from typing import Any

import numpy as np

from igrow.core.co2_count import CO2Count, co2_since_planting
from igrow.core.economics import running_costs
from igrow.core.language import N_
from igrow.core.planner.recent_use import used_in
from igrow.core.site import Site
from igrow.core.telemetry import Telemetry
from igrow.edge.page.words import Words

ROWS = (
    ("income", N_("Growth, when it is sold")),
    ("heat", N_("Heat")),
    ("electricity", N_("Electricity")),
    ("co2", N_("CO2")),
)
KINDS = ("heat", "electricity", "co2")
TOLD = ("income", *KINDS, "profit")
"""What an explanation holds of plan and recipe."""


@dataclass(frozen=True)
class Expected:
    """What a plan is expected to bring beside the recipe, EUR for the greenhouse."""

    rows: tuple[tuple[str, str, str, str], ...]
    """Title, plan, recipe, difference."""
    gain: str
    """One sentence."""


def expected(plan: Mapping[str, Any], area: float, say: Words) -> Expected | None:
    """Return the plan's money over its horizon; None where the daemon has no explanation. `area` is in m2."""
    explained = plan.get("explanation")
    if not explained:
        return None
    amounts = {name: tuple(explained[who][name]["mean"] * area for who in ("plan", "recipe")) for name in TOLD}
    # What is charged beside the costs that are told one by one.
    amounts["upkeep"] = tuple(
        growth - sum(amounts[name][column] for name in (*KINDS, "profit"))
        for column, growth in enumerate(amounts["income"])
    )
    rows = [
        (say.text(title), say.euro(ours), say.euro(usual), say.euro(ours - usual, sign=True))
        for name, title in (*ROWS, ("upkeep", N_("Upkeep of the crop")), ("profit", N_("What is left")))
        for ours, usual in (amounts[name],)
    ]
    mean, deviation = (explained["gain"][key] * area for key in ("mean", "deviation"))
    low, high = mean - 1.96 * deviation, mean + 1.96 * deviation
    ends = {"low": say.euro(low, sign=True), "high": say.euro(high, sign=True)}
    sure = "" if high - low < 0.01 else say.text(", between {low} and {high}", **ends)
    # Rounded as it is shown: what would be said as nothing is no gain.
    if abs(mean) < 0.005:
        text = say.text("The plan and your recipe are expected to bring the same.")
    else:
        more = N_("The plan is expected to bring {amount} more than your recipe{sure}.")
        less = N_("The plan is expected to bring {amount} less than your recipe{sure}.")
        text = say.text(more if mean > 0 else less, amount=say.euro(abs(mean)), sure=sure)
    return Expected(tuple(rows), text)


@dataclass(frozen=True)
class Spent:
    """What a day has cost so far, EUR for the greenhouse, as far as the log tells."""

    costs: Mapping[str, float]
    """By `KINDS`; NaN where nothing tells."""
    hours: int
    """Whole hours of the day that are counted."""

    @property
    def total(self) -> float:
        """Of what is known; NaN where nothing is."""
        known = [cost for cost in self.costs.values() if math.isfinite(cost)]
        return sum(known) if known else math.nan


def spent(site: Site, log: Telemetry, now: float, zone: tzinfo, counted: CO2Count | None = None) -> Spent:
    """Return what the whole hours of the local day have cost, told from the actuators as plans are charged.

    `log` holds that day at least; `counted`, and what it holds since, tells which price of CO2 is reached.
    """
    midnight = datetime.fromtimestamp(now, zone).replace(hour=0, minute=0, second=0, microsecond=0).timestamp()
    starts = np.arange(midnight, now - 3600.0 + 1.0, 3600.0)
    times = starts.astype(np.int64).astype("datetime64[s]")
    used = [used_in(log.select(time, time + np.timedelta64(3600, "s")), site.greenhouse) for time in times]
    amounts = {name: np.array([hour[name] for hour in used], dtype=np.float64) for name in KINDS}
    known = {name: np.isfinite(values) for name, values in amounts.items()}
    heat, electricity, co2 = (np.where(known[name], amounts[name], 0.0) for name in KINDS)
    before = max(co2_since_planting(site, log, int(now), counted) - float(co2.sum()), 0.0)
    balance = running_costs(
        site.prices, site.time_zone, times, heat, electricity, co2, stem_density=0.0, co2_before=before
    )
    area = site.greenhouse.floor_area
    costs = {name: float(getattr(balance, name)) * area if known[name].any() else math.nan for name in KINDS}
    return Spent(costs, len(starts))
