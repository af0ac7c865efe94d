"""Tables of the hybrid simulator on measured greenhouses.

later     fitted on the first weeks, tested on all later ones
weekly    refitted before each test week, as a site in operation is (K2 = 7 days)
metered   heat, electricity and CO2 that plans are charged for, told from the actuators, against the meters
across    fitted on the other compartments, tested on this one; and with its first 7 days for calibration
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
from sklearn.ensemble import HistGradientBoostingRegressor

from benchmarks.forecasts.combination import remembering
from benchmarks.forecasts.forecaster import Forecaster, adapt, fit_forecaster, from_few_days
from benchmarks.forecasts.totals import coverage, daily_totals
from benchmarks.forecasts.uncertainty import ErrorGrowth
from benchmarks.measured_network import network_predictor
from igrow.core.arrays import Floats, Integers, Mask
from igrow.core.economics import local_days
from igrow.core.errors import IgrowError
from igrow.core.planner.recent_use import used_in
from igrow.core.simulator.hybrid.nominal import site_record
from igrow.core.simulator.hybrid.record import Record
from igrow.core.telemetry import Telemetry
from igrow.trainer.data import Log, read_log
from igrow.trainer.data.public import challenge
from igrow.trainer.data.splits import weeks
from igrow.trainer.exporting.plan import RANGED
from igrow.trainer.fit.actuation import setpoint_columns
from igrow.trainer.fit.climate import site_prior
from igrow.trainer.fit.evaluation import Errors, Predictor, errors_of, starts_within, summarise
from igrow.trainer.fit.model import training_envelope

STEP = 300.0
HORIZONS = ("1_h", "24_h", "7_d")
UNITS = {"air_temperature": "K", "air_humidity": "%", "air_co2": "ppm"}


class Greenhouse:
    """A log, its record and setpoints."""

    def __init__(self, log: Log) -> None:
        self.log, self.site = log, log.known_site
        self.record: Record = site_record(log.telemetry, log.known_site, STEP)
        self.setpoints, self.inferred = setpoint_columns(log.telemetry, self.record, self.site)
        self.week = weeks(self.record.time)

    def fit(self, fit: Mask, selection: Mask, **options: object) -> Forecaster:
        return fit_forecaster([(self.record, self.setpoints, fit, selection)], site_prior(self.site), {}, **options)  # type: ignore[arg-type]


Predictors = Mapping[str, tuple[Predictor, Mapping[str, ErrorGrowth]]]


def predictors(greenhouse: Greenhouse, model: Forecaster) -> Predictors:
    """All ways to drive a model, with their intervals."""
    by_actuators = remembering(model.predictor(greenhouse.record))
    found = {"hybrid, actuators": (by_actuators, model.growth)}
    if model.rules:
        by_setpoints = remembering(model.closed_predictor(greenhouse.record, greenhouse.setpoints))
        found["hybrid, setpoints"] = (by_setpoints, model.closed_growth)
        if model.combinations:
            both = model.combined_predictor(greenhouse.record, greenhouse.setpoints, by_actuators, by_setpoints)
            found["hybrid, combined"] = (remembering(both), model.combined_growth)
    return found


def all_errors(
    greenhouse: Greenhouse, ways: Predictors, rows: Mask, begin: Mask | None, every: float
) -> dict[str, dict[tuple[str, str], Errors]]:
    return {
        name: errors_of(greenhouse.record, predict, HORIZONS, rows, begin=begin, every=every)
        for name, (predict, _) in ways.items()
    }


def rivals(
    greenhouse: Greenhouse, fit: Mask, rows: Mask, begin: Mask | None, every: float
) -> dict[str, dict[tuple[str, str], Errors]]:
    """What learns from the same rows and knows no physics, driven by the measured actuators."""
    network = network_predictor(greenhouse.record, greenhouse.setpoints, fit)
    return {
        "network": errors_of(greenhouse.record, network, HORIZONS, rows, begin=begin, every=every),
        "gradient boosting": boosted(greenhouse, fit, rows, begin, every),
    }


def boosted(
    greenhouse: Greenhouse, fit: Mask, rows: Mask, begin: Mask | None, every: float
) -> dict[tuple[str, str], Errors]:
    """A plain gradient-boosted regression: drivers now and an hour ago, the measured start, and the lead time."""
    record = greenhouse.record
    generator = np.random.default_rng(0)
    columns = [*record.inputs, *greenhouse.setpoints]
    table = np.stack([*record.inputs.values(), *greenhouse.setpoints.values()], axis=1)
    lag = round(3600.0 / STEP)
    quantities = list(record.measured)
    measured = np.stack([record.measured[name] for name in quantities], axis=1)

    def features(starts: Integers, target: Integers) -> Floats:
        lead = (target - starts)[:, None] * STEP / 3600.0
        return np.concatenate(
            [table[target - 1], table[np.maximum(target - 1 - lag, starts)], measured[starts], np.minimum(lead, 24.0)],
            axis=1,
        )

    assert len(columns) == table.shape[1]
    usable = np.flatnonzero(fit[:-300])
    starts = generator.choice(usable, 40_000)
    target = starts + 1 + np.floor(287 * generator.random(len(starts)) ** 2).astype(np.int64)
    keep = fit[target]
    starts, target = starts[keep], target[keep]
    models = {}
    for position, name in enumerate(quantities):
        good = np.isfinite(measured[target, position]) & np.isfinite(measured[starts]).all(axis=1)
        models[name] = HistGradientBoostingRegressor(max_iter=200, learning_rate=0.08, random_state=0).fit(
            features(starts[good], target[good]), measured[target[good], position]
        )

    def predict(begin_rows: Integers, steps: int) -> Mapping[str, Floats]:
        stride = 1 if steps <= 300 else 6
        leads = np.arange(0, steps, stride)
        result = {name: np.full((steps, len(begin_rows)), np.nan) for name in quantities}
        ahead = np.broadcast_to(begin_rows, (len(leads), len(begin_rows)))
        rows_ahead = ahead + 1 + leads[:, None]
        inputs = features(ahead.ravel(), rows_ahead.ravel())
        for name, one in models.items():
            result[name][leads] = one.predict(inputs).reshape(len(leads), -1)
        return result

    return errors_of(record, predict, HORIZONS, rows, begin=begin, every=every)


def show(title: str, found: Mapping[str, Sequence[Mapping[tuple[str, str], Errors]]]) -> dict[str, object]:
    """Print one table and return it for JSON."""
    print(f"\n{title}")
    print(f"{'':24s}" + "".join(f"{horizon:>31s}" for horizon in HORIZONS))
    result: dict[str, object] = {}
    summaries = {name: summarise(parts) for name, parts in found.items()}
    for quantity, unit in UNITS.items():
        naive = next(iter(summaries.values())).get(quantity, {})
        line = "".join(f"{naive[h].persistence:12.3g}{'':19s}" if h in naive else " " * 31 for h in HORIZONS)
        print(f"{quantity} ({unit})\n  {'persistence':22s}{line}")
        for name, summary in summaries.items():
            cells = "".join(
                f"{one.mae:12.3g} [{one.mae_low:.3g}, {one.mae_high:.3g}]".ljust(31) if one else " " * 31
                for one in (summary.get(quantity, {}).get(h) for h in HORIZONS)
            )
            print(f"  {name:22s}{cells}")
    for name, summary in summaries.items():
        result[name] = {q: {h: asdict(one) for h, one in by.items()} for q, by in summary.items()}
    return result


def later(greenhouse: Greenhouse, every: float) -> dict[str, object]:
    count = int(greenhouse.week[-1]) + 1
    fit_weeks, selection_weeks = round(0.6 * count), max(2, round(0.15 * count))
    fit = greenhouse.week < fit_weeks
    selection = (greenhouse.week >= fit_weeks) & (greenhouse.week < fit_weeks + selection_weeks)
    rows = greenhouse.week >= fit_weeks + selection_weeks
    began = time.monotonic()
    model = greenhouse.fit(fit, selection)
    print(f"{greenhouse.log.name}: fitted in {time.monotonic() - began:.0f} s")
    ways = predictors(greenhouse, model)
    found = {name: [errors] for name, errors in all_errors(greenhouse, ways, rows, None, every).items()}
    found |= {name: [errors] for name, errors in rivals(greenhouse, fit | selection, rows, None, every).items()}
    title = (
        f"{greenhouse.log.name}, later: weeks 1-{fit_weeks} fit, {selection_weeks} selection, "
        f"{count - fit_weeks - selection_weeks} test"
    )
    table = show(title, found)
    print_coverage([coverage(greenhouse.record, ways, rows, None, every)])
    print_range(greenhouse, ways["hybrid, setpoints"][0], fit, rows, every)
    print_totals([daily_totals(greenhouse.record, greenhouse.setpoints, model, rows)])
    return table


def weekly(
    greenhouse: Greenhouse, every: float, refit: int, chosen: Sequence[int] | None, first: int = 8
) -> dict[str, object]:
    found: dict[str, list[Mapping[tuple[str, str], Errors]]] = {}
    covered, totals = [], []
    count = int(greenhouse.week[-1]) + 1
    tested = [week for week in range(first, count, refit) if chosen is None or week + 1 in chosen]
    for test in tested:
        fit = (greenhouse.week >= test - 8) & (greenhouse.week < test - 2)
        selection = (greenhouse.week >= test - 2) & (greenhouse.week < test)
        model = greenhouse.fit(fit, selection)
        begin, rows = (greenhouse.week >= test) & (greenhouse.week < test + refit), greenhouse.week >= test
        ways = predictors(greenhouse, model)
        for name, errors in all_errors(greenhouse, ways, rows, begin, every).items():
            found.setdefault(name, []).append(errors)
        for name, errors in rivals(greenhouse, fit | selection, rows, begin, every).items():
            found.setdefault(name, []).append(errors)
        covered.append(coverage(greenhouse.record, ways, rows, begin, every))
        totals.append(daily_totals(greenhouse.record, greenhouse.setpoints, model, rows, begin))
        print(f"week {test + 1} of {count} done", file=sys.stderr)
    names = ", ".join(str(week + 1) for week in tested)
    table = show(f"{greenhouse.log.name}, weekly: refitted every {refit} weeks; tested on weeks {names}", found)
    print_coverage(covered)
    print_totals(totals)
    return table


def across(greenhouses: Sequence[Greenhouse], every: float) -> dict[str, object]:
    tables: dict[str, object] = {}
    for greenhouse in greenhouses:
        others = [one for one in greenhouses if one is not greenhouse]
        parts = [(one.record, one.setpoints, one.week % 4 != 3, one.week % 4 == 3) for one in others]
        model = fit_forecaster(parts, site_prior(greenhouse.site), {}, actuation=False)
        rows, later_rows = np.ones(len(greenhouse.record), dtype=bool), greenhouse.week >= 1
        found = {
            "fitted on others": [
                errors_of(greenhouse.record, model.predictor(greenhouse.record), HORIZONS, rows, every=every)
            ]
        }
        first = greenhouse.week < 1
        adapted = adapt(model, greenhouse.record, first)
        found["and first 7 days"] = [
            errors_of(greenhouse.record, adapted.predictor(greenhouse.record), HORIZONS, later_rows, every=every)
        ]
        alone = from_few_days(greenhouse.record, first, site_prior(greenhouse.site))
        found["first 7 days alone"] = [
            errors_of(greenhouse.record, alone.predictor(greenhouse.record), HORIZONS, later_rows, every=every)
        ]
        tables[greenhouse.log.name] = show(f"{greenhouse.log.name}, across", found)
    return tables


METERS: Mapping[str, tuple[str, tuple[tuple[str, ...], ...]]] = {
    "heat": ("MJ m-2", (("heat",),)),
    "electricity": ("kWh m-2", (("electricity_peak", "electricity_off_peak"), ("electricity",))),
    "co2": ("kg m-2", (("co2",),)),
}
"""What plans are charged for: its unit, and the columns whose sum is its meter, as data sets have them."""


def metered(log: Log) -> dict[str, object]:
    """Daily use as `recent_use.used_in` tells it from a log, against the data set's own meters."""
    if log.site is None or log.resources is None:
        print(f"\n{log.name}: no meters are read from this data set")
        return {}
    telemetry, table = log.telemetry, log.resources
    local = local_days(telemetry.time, log.site.time_zone)
    meters = {
        name: (unit, np.sum([table[column] for column in columns], axis=0))
        for name, (unit, ways) in METERS.items()
        for columns in ways
        if all(column in table for column in columns)
    }
    used: dict[str, list[float]] = {name: [] for name in meters}
    for day in table.day:
        rows = local == day
        of_day = Telemetry(telemetry.time[rows], {name: values[rows] for name, values in telemetry.columns.items()})
        found = used_in(of_day, log.site.greenhouse)
        for name in meters:
            used[name].append(found[name])
    print(f"\n{log.name}: told from the actuators, metered, difference of the sums, median day's difference")
    result: dict[str, object] = {}
    for name, (unit, measured) in meters.items():
        told = np.array(used[name])
        both = np.isfinite(told) & np.isfinite(measured)
        if not both.any():
            print(f"  {name + ' (' + unit + ')':24s} not told by the log")
            continue
        worth = both & (measured > 0.05 * np.nanmean(measured))
        median = float(np.median(np.abs(told - measured)[worth] / measured[worth]))
        sums = float(told[both].sum()), float(measured[both].sum())
        print(
            f"  {name + ' (' + unit + ')':24s} {sums[0]:10.4g} {sums[1]:10.4g} "
            f"{100 * (sums[0] / sums[1] - 1):+7.1f} % {100 * median:7.1f} %  ({both.sum()} days)"
        )
        result[name] = {"told": sums[0], "metered": sums[1], "median_day": median, "days": int(both.sum())}
    return result


def print_coverage(parts: Sequence[Mapping[tuple[str, str], tuple[float, float]]]) -> None:
    print("\ncoverage of 90 % intervals")
    pooled: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for part in parts:
        for key, value in part.items():
            pooled.setdefault(key, []).append(value)
    for (driven, what), values in pooled.items():
        inside, number = np.sum(np.array(values), axis=0)
        print(f"  {driven:10s} {what:28s} {inside / max(number, 1):.3f}")


def print_range(greenhouse: Greenhouse, predict: Predictor, fit: Mask, rows: Mask, every: float) -> None:
    """Tell whether runs outside the training range are worse: the error of 24 h runs.

    Outside is what a bundle's graph tells planning: beyond the bounds of single quantities
    (`igrow.trainer.fit.model.training_envelope`).
    """
    record = greenhouse.record
    known = {**record.inputs, **record.measured, **greenhouse.setpoints}
    bounds = training_envelope({name: known[name][fit] for name in RANGED})
    excess = [np.maximum(low - known[name], known[name] - high) for name, (low, high) in bounds.items()]
    outside = np.max(excess, axis=0) > 0.0
    steps = round(86_400.0 / record.step)
    starts = starts_within(record, rows, steps, max(1, round(every / record.step)))
    ahead = starts + 1 + np.arange(steps)[:, None]
    errors = {
        name: np.nanmean(np.abs(values - record.measured[name][ahead]), axis=0)
        for name, values in predict(starts, steps).items()
        if name in record.measured
    }
    print("\nerror of 24 h runs by the share of their rows outside the training range")
    share = outside[ahead].mean(axis=0)
    for title, chosen in (
        ("none", share == 0.0),
        ("up to 20 %", (share > 0.0) & (share <= 0.2)),
        ("more", share > 0.2),
    ):
        cells = "".join(f"{name} {np.nanmean(error[chosen]):8.3g}  " for name, error in errors.items() if chosen.any())
        print(f"  {title:10s} {chosen.sum():5d} runs  {cells}")


def print_totals(parts: Sequence[Mapping[str, Floats]]) -> None:
    print("\ndaily totals from setpoints: predicted, measured, difference of the sums, median day's difference")
    names = list(dict.fromkeys(name for part in parts for name in part))
    for name in names:
        pairs = np.concatenate([part[name] for part in parts if name in part], axis=1)
        predicted, measured = pairs
        if measured.sum() <= 0:
            continue
        worth = measured > 0.05 * measured.mean()
        median = np.median(np.abs(predicted - measured)[worth] / measured[worth])
        print(
            f"  {name:24s} {predicted.mean():10.4g} {measured.mean():10.4g} "
            f"{100 * (predicted.sum() / measured.sum() - 1):+7.1f} % {100 * median:7.1f} %"
        )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, help="folder of the data set")
    parser.add_argument("compartments", nargs="*", help="names; none: all that have a climate file")
    parser.add_argument("--tables", nargs="+", choices=("later", "weekly", "across", "metered"), default=["later"])
    parser.add_argument("--every", type=float, default=11_100.0, help="seconds between starts of test runs")
    parser.add_argument("--refit", type=int, default=1, help="weeks between refits of the table weekly")
    parser.add_argument("--test-weeks", nargs="+", type=int, help="of the table weekly; none: all from the ninth on")
    parser.add_argument("--json", type=Path, help="file for the tables")
    given = parser.parse_args()
    try:
        names = given.compartments or challenge.compartments(given.data, "GreenhouseClimate", "Greenhouse_climate")
        logs = [read_log(given.data, compartment=name) for name in names] or [read_log(given.data)]
        result: dict[str, object] = {}
        if "metered" in given.tables:
            result["metered"] = {log.name: metered(log) for log in logs}
        greenhouses = [Greenhouse(log) for log in logs] if set(given.tables) != {"metered"} else []
    except IgrowError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    for table in given.tables:
        if table == "across":
            result["across"] = across(greenhouses, given.every)
        elif table != "metered":
            result[table] = {
                greenhouse.log.name: later(greenhouse, given.every)
                if table == "later"
                else weekly(greenhouse, given.every, given.refit, given.test_weeks)
                for greenhouse in greenhouses
            }
    if given.json is not None:
        given.json.write_text(json.dumps(result, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
