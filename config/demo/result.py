"""What the demo shows at its end: one table, one figure, and `result.json` with the same numbers."""

from __future__ import annotations

import json
from dataclasses import dataclass
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

from igrow.core.bundle import read_bundle
from igrow.core.planner.objective import Objective
from igrow.core.planner.season import SeasonPlan
from igrow.core.planner.season.worth import CropWorth
from igrow.core.quantities import QUANTITIES
from igrow.core.simulator.hindcast import HindcastPredictor
from igrow.core.simulator.outcome import Outcome
from igrow.core.site import Site, load_site
from igrow.core.telemetry import Telemetry, read_csv, to_grid
from igrow.trainer.service.archive import Archive

PREDICTED = ("air_temperature", "air_humidity", "air_co2")
DAY = 288
"""Rows of five minutes."""


@dataclass(frozen=True)
class Days:
    """When what happened, in days since the daemon took over."""

    broken: int
    diagnosed: int


def summarise(out: Path, effect: str, days: Days) -> str:
    """Write result.json and demo.png into `out`, and return the table for the terminal."""
    site = load_site(out / "site.yaml")
    exchange = Archive(out / "trainer/archive").read("demo", date(2000, 1, 1), datetime.now(UTC).date())
    log = to_grid(exchange.telemetry, 300)
    first = read_bundle(out / "first-bundle")
    corrected = read_bundle(out / "diagnosis/bundle")
    adopted = [event for event in exchange.events if event.get("kind") == "bundle_adopted"]
    live = {
        "first": live_error(first, log),
        "corrected": live_error(corrected, log),
    }
    since = adoption_day(adopted, log)
    diagnosis = json.loads((out / "diagnosis/diagnosis.json").read_text())
    nothing = json.loads((out / "nothing-diagnosis/diagnosis.json").read_text())
    money = compare_money(
        site, log, recipe_season(out), exchange.events, since, (SeasonPlan.of(first), SeasonPlan.of(corrected))
    )
    result = {
        "effect": effect,
        "verdict": diagnosis["verdict"],
        "findings": diagnosis["findings"],
        "held_out_errors": diagnosis["errors"],
        "oracle_errors_24_h": json.loads((out / "diagnosis/truth.json").read_text())["errors_24_h"],
        "broken_on": str(log.time[0].astype("datetime64[D]") + days.broken),
        "found_since": found_since(diagnosis),
        "verdict_without_effect": nothing["verdict"],
        "adopted_on_day": since,
        "live_error_24_h": {
            name: {
                "first_bundle_while_well": mean(live["first"][name][: days.broken]),
                "first_bundle_since_it_broke": mean(live["first"][name][days.broken : days.diagnosed]),
                "first_bundle_after": mean(live["first"][name][since:]) if since else None,
                "bundle_in_force_after": mean(live["corrected"][name][since:]) if since else None,
                "unit": QUANTITIES[name].difference_unit,
            }
            for name in PREDICTED
        },
        "money": money,
    }
    (out / "result.json").write_text(json.dumps(result, indent=2))
    draw(out / "demo.png", live, since, days, log, diagnosis)
    return table(result)


def found_since(diagnosis: Any) -> str | None:
    """Return when the first cause was found to have begun (UTC), None where it was always there."""
    onsets = [one["onset"] for one in diagnosis["findings"] if one.get("onset")]
    return str(onsets[0]["time"])[:16].replace("T", " ") if onsets else None


def live_error(bundle: Any, log: Telemetry) -> dict[str, NDArray[np.float64]]:
    """Return the mean absolute error of the 24 h prediction that starts each midnight, by quantity, (days,)."""
    origins = np.arange(0, len(log) - DAY, DAY)
    predicted = HindcastPredictor().predict(bundle, log, origins, DAY)
    rows = origins[:, None] + 1 + np.arange(DAY)
    return {name: np.nanmean(np.abs(predicted[name] - log[name][rows]), axis=1) for name in PREDICTED}


def adoption_day(adopted: list[Any], log: Telemetry) -> int | None:
    """Return the first whole day under the corrected bundle, counted from the log's first row."""
    if not adopted:
        return None
    moment = np.datetime64(int(adopted[-1]["time"]), "s")
    return int(np.ceil((moment - log.time[0]) / np.timedelta64(1, "D")))


def recipe_season(out: Path) -> Telemetry:
    """Return the log of the same greenhouse under the recipe."""
    return to_grid(read_csv(next((out / "recipe").glob("*.csv.gz"))), 300)


def obtained(site: Site, log: Telemetry, seasons: dict[int, SeasonPlan | None], co2: float) -> NDArray[np.float64]:
    """Return what each day was worth by the planner's own rules, from what was measured, EUR m-2.

    The days have the season of the bundle that was in force; the crop has had `co2` kg m-2 when the log begins.
    """
    physical = site.greenhouse
    rail = np.maximum(log["rail_pipe_temperature"] - log["air_temperature"], 0.0)
    grow = np.maximum(log["grow_pipe_temperature"] - log["air_temperature"], 0.0)
    heat = physical.rail_pipe_heat_transfer * rail + physical.grow_pipe_heat_transfer * grow
    hourly = {
        "heat": heat * 3.6e-3,
        "electricity": log["lamp_power"] * 1e-3,
        "co2": log["co2_dosing"],
        "net_growth": np.gradient(log["net_growth"]) * 12.0,
        "fruit_fresh_weight": np.gradient(log["fruit_fresh_weight"]) * 12.0,
    } | {name: log[name] for name in (*PREDICTED, "leaf_area_index")}
    had = co2 + dosed(log)
    worth = []
    for day, season in seasons.items():
        rows = slice(day * DAY, (day + 1) * DAY)
        means = {name: np.nanmean(values[rows].reshape(24, 12), axis=1)[None, None] for name, values in hourly.items()}
        outcome = Outcome(**means, outside=np.zeros((1, 1, 24)))
        time = log.time[rows][::12]
        value = Objective(site, time, had[day], crop_worth(site, log, day, season))
        worth.append(float(value.value(outcome).profit[0, 0]))
    return np.array(worth)


def crop_worth(site: Site, log: Telemetry, day: int, season: SeasonPlan | None) -> CropWorth | None:
    """Return what a season says that the crop of a log is worth when a day begins; None without one."""
    if season is None:
        return None
    counted = {name: float(log[name][day * DAY]) for name in ("leaf_area_index", "plant_load")}
    before = log["air_temperature"][max(day - 1, 0) * DAY : max(day, 1) * DAY]
    return season.worth(site, log.time[day * DAY], counted, float(np.nanmean(before)))


def dosed(log: Telemetry) -> NDArray[np.float64]:
    """Return the CO2 dosed before each midnight of a log, kg m-2, (days + 1,)."""
    rows = np.nan_to_num(log["co2_dosing"])[: len(log) // DAY * DAY]
    return np.append(0.0, np.cumsum(rows.reshape(-1, DAY).sum(axis=1) / 12.0))


def compare_money(
    site: Site,
    log: Telemetry,
    recipe: Telemetry,
    events: Any,
    since: int | None,
    seasons: tuple[SeasonPlan | None, SeasonPlan | None] = (None, None),
) -> dict[str, Any]:
    """Return expected and obtained worth, plan against recipe, EUR m-2 per day, before and after the adoption.

    Days of weather differ more than plan and recipe do: the gain has the standard error of its days. `seasons` are
    those of the first bundle and of the one that was adopted.
    """
    days = min(len(log), len(recipe)) // DAY
    plans: dict[int, Any] = {}
    for event in events:
        if event.get("kind") == "plan":
            detail = event.get("detail", event)
            start = np.datetime64(str(detail["start"]).removesuffix("+00:00").removesuffix("Z"), "s")
            plans[int((start - log.time[0]) // np.timedelta64(1, "D"))] = detail
    number = np.array(sorted(day for day in plans if 0 <= day < days), dtype=np.int64)
    if not len(number):
        return {}
    expected, usual = (np.array([plans[day][key] for day in number]) for key in ("expected_profit", "recipe_profit"))
    # Both greenhouses were one until the first plan.
    co2 = plans[number[0]]["co2_before"] - float(dosed(log)[number[0]])
    by_day = {day: seasons[since is not None and day >= since] for day in number.tolist()}
    plan, other = obtained(site, log, by_day, co2), obtained(site, recipe, by_day, co2)
    spans = {"all": number >= 0}
    if since is not None:
        spans = {"first bundle": number < since, "corrected bundle": number >= since}
    return {
        name: {
            "days": int(span.sum()),
            "plan_expected": mean(expected[span]),
            "plan_obtained": mean(plan[span]),
            "recipe_expected": mean(usual[span]),
            "recipe_obtained": mean(other[span]),
            "gain_expected": mean((expected - usual)[span]),
            "gain_obtained": mean((plan - other)[span]),
            "gain_standard_error": standard_error((plan - other)[span]),
            "unit": "EUR m-2 d-1",
        }
        for name, span in spans.items()
    }


def standard_error(values: NDArray[np.float64]) -> float:
    """Return that of a mean; NaN for fewer than two values."""
    return float(values.std(ddof=1) / np.sqrt(len(values))) if len(values) > 1 else float("nan")


def mean(values: NDArray[np.float64]) -> float:
    """Return the mean of what is there, NaN for nothing."""
    return float(np.nanmean(values)) if np.isfinite(values).any() else float("nan")


def table(result: dict[str, Any]) -> str:
    """Return the result as text."""
    oracle = result["oracle_errors_24_h"]
    lines = ["error on unseen days, 24 h ahead    as deployed   recalibrated    with the    the truth"]
    lines.append(f"{'':62}cause found     known")
    for name, horizons in result["held_out_errors"].items():
        row = horizons.get("24_h")
        if row:
            stages = "".join(f"{row[stage]:14.3f}" for stage in ("deployed", "recalibrated", "corrected"))
            lines.append(f"  {name:31}{stages}{oracle.get(name, float('nan')):13.3f}   {row['unit']}")
    lines += ["", "live error of the daemon, 24 h    first bundle:                                 corrected bundle"]
    lines.append(f"{'':30}all is well  since it broke  after adoption    after adoption")
    for name, row in result["live_error_24_h"].items():
        first = [row[f"first_bundle_{when}"] for when in ("while_well", "since_it_broke", "after")]
        cells = [*first, row["bundle_in_force_after"]]
        lines.append(
            f"  {name:24}"
            + "".join("              -" if x is None else f"{x:15.3f}" for x in cells)
            + f"   {row['unit']}"
        )
    lines += ["", f"{'worth of a day, EUR m-2':29}by plans:         by the recipe:    more by plans:"]
    lines.append(f"{'':28}" + " expected obtained" * 3)
    for name, row in result["money"].items():
        keys = [f"{side}_{when}" for side in ("plan", "recipe", "gain") for when in ("expected", "obtained")]
        amounts = "".join(f"{row[key]:9.3f}" for key in keys)
        who = f"{name}, {row['days']} days"
        lines.append(f"  {who:26}{amounts} +- {row['gain_standard_error']:.3f}")
    named = ", ".join(one["effect"] for one in result["findings"]) or "nothing"
    lines += ["", f"undeclared effect: {result['effect']}, since {result['broken_on']}"]
    lines.append(f"found: {result['verdict']} ({named}), since {result['found_since'] or 'before the log begins'}")
    lines.append(f"had nothing broken: {result['verdict_without_effect']}")
    return "\n".join(lines)


def draw(path: Path, live: Any, since: int | None, days: Days, log: Telemetry, diagnosis: Any) -> None:
    """Draw the figure: the live error climbs when something breaks, and falls with the corrected bundle."""
    figure, axes = plt.subplots(3, 1, figsize=(9.0, 7.2), sharex=True, layout="constrained")
    found = ", ".join(one["effect"].replace("_", " ") for one in diagnosis["findings"]) or "nothing"
    moments = [(days.broken, "it breaks", "#b3261e"), (days.diagnosed, "diagnosed", "#6b7280")]
    if since is not None:
        moments.append((since, "adopted", "#1f8a4c"))
    for axis, name, title in zip(axes, PREDICTED, ("air temperature", "relative humidity", "CO2"), strict=True):
        first, corrected = live["first"][name], live["corrected"][name]
        day = np.arange(len(first)) + 0.5
        axis.plot(day, first, color="#b0b6bd", lw=1.6, label="first bundle" if axis is axes[0] else None)
        if since is not None:
            label = "corrected bundle, in force" if axis is axes[0] else None
            axis.plot(day[since:], corrected[since:], color="#1f8a4c", lw=2.2, label=label)
        for moment, _, colour in moments:
            axis.axvline(moment, color=colour, lw=0.9, ls="--")
        axis.set_ylabel(f"{title}\n{QUANTITIES[name].difference_unit}")
        axis.set_ylim(0, 1.25 * float(np.nanmax(first)))
        axis.grid(alpha=0.25)
        axis.spines[["top", "right"]].set_visible(False)
    for moment, text, colour in moments:
        axes[0].text(moment - 0.15, axes[0].get_ylim()[1], text, va="top", ha="right", color=colour, rotation=90)
    begun = found_since(diagnosis)
    if begun is not None:
        place = float((np.datetime64(begun) - log.time[0]) / np.timedelta64(1, "D"))
        label = f"found to have begun {begun}"
        axes[0].plot([place], [0.0], marker="^", ms=9, ls="", color="#b3261e", clip_on=False, label=label)
    axes[0].set_title(f"Error of the 24 h prediction, day by day\nfound by the trainer: {found}", loc="left")
    figure.legend(loc="outside lower center", ncols=3, frameon=False)
    axes[-1].set_xlabel("day since the daemon took over")
    figure.savefig(path, dpi=120)
    plt.close(figure)
