"""Fit the bounds of a diagnosis that are fitted: quantiles of what logs with nothing hidden gain, from tuning seeds.

The nuisance subspace that a log is seen under is learned from other greenhouses than its own, fold by fold, so that a
bound is that of greenhouses which nothing was learned from. No case of a benchmark has these seeds.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.diagnosis import factor_analysis
from benchmarks.diagnosis.factor_analysis import LogLikelihood
from benchmarks.diagnosis.greenhouses import PLACES_SEED, VirtualGreenhouse, others
from benchmarks.diagnosis.matched import STEP, matched_log
from benchmarks.diagnosis.nuisance import (
    FOLDS,
    MONTH,
    PLACES,
    Family,
    at_home,
    design_of,
    families,
    simulate,
    transferred,
    transferred_logs,
)
from benchmarks.jobs import Jobs
from benchmarks.provenance import provenance
from igrow.core.telemetry import Telemetry
from igrow.trainer.diagnosis import DEFAULT, compare, linear, search
from igrow.trainer.diagnosis.design import Design
from igrow.trainer.diagnosis.nuisance import Direction
from igrow.trainer.diagnosis.rules import FILE, DecisionRules
from igrow.trainer.diagnosis.structure import disagreement

COMMAND = "python -m benchmarks.diagnosis rules"
RULES = Path(str(files("igrow.trainer.diagnosis"))) / FILE
QUANTILES = {
    "least_gain_steps": 0.95,
    "least_gain": 0.875,
    "least_gain_transferred": 0.9375,
    "pattern_gain": 0.96,
    "pattern_gain_transferred": 0.979,
}
"""Share of logs with nothing missing whose largest gain must stay below the bound."""
MATCHED_SEED = 95_000


@dataclass(frozen=True)
class Gains:
    """The largest gains in one log in which nothing is missing."""

    cause: float
    pattern: float
    disagreement: float


def largest_gains(design: Design) -> tuple[float, float]:
    """Return the largest gain of a cause and of a pattern, as the search would compare them with its bounds."""
    rng = np.random.default_rng(0)
    null = compare.profile(design, design.null_model())
    fit = linear.fit(design.grams, null.model)
    causes = search.score_candidates(design, fit, search.onset_days(design), rng)
    patterns = search.score_patterns(design, fit, compare.pattern_onsets(design), rng)
    of_causes = [
        one.hypothesis.gain
        for one in compare.contest(design, null, causes, rng)
        if compare.is_within_bounds(design, one)
    ]
    of_patterns = [
        one.hypothesis.gain / (design.rules.clock_factor if compare.is_steady(one.hypothesis) else 1.0)
        for one in compare.contest(design, null, patterns, rng)
        if one.bootstrap_p <= design.rules.largest_bootstrap_p
    ]
    return max(of_causes, default=0.0), max(of_patterns, default=0.0)


def gains_of(job: tuple[Family, Telemetry, Sequence[Direction]]) -> Gains:
    """Return what one log gains under directions."""
    family, log, directions = job
    hours = design_of(family, log, directions)
    steps = design_of(family, log, interval=hours.line.record.step)
    return Gains(*largest_gains(hours), disagreement(hours, steps))


def matched_gains(job: tuple[Family, Telemetry, int]) -> Gains:
    """Return what a log of the simulator's own structure gains, time step by time step."""
    family, driven, seed = job
    bare = replace(family, model=replace(family.model, discrepancy={}, alignment=0.0))
    log = matched_log(driven, bare.model, (), np.random.default_rng(seed))
    hours, steps = design_of(bare, log), design_of(bare, log, interval=STEP)
    return Gains(*largest_gains(steps), disagreement(hours, steps))


def bounds(own: Sequence[Gains], other: Sequence[Gains], matched: Sequence[Gains]) -> dict[str, float]:
    """Return the fitted rules, rounded up to what their logs can tell.

    Args:
        own: of models calibrated on the greenhouse itself.
        other: of models calibrated on another greenhouse.
        matched: of greenhouses of the simulator's own structure.
    """
    found = {
        "least_gain_steps": [one.cause for one in matched],
        "least_gain": [one.cause for one in own],
        "least_gain_transferred": [one.cause for one in other],
        "pattern_gain": [one.pattern for one in own],
        "pattern_gain_transferred": [one.pattern for one in other],
    }
    fitted = {name: float(np.ceil(np.quantile(values, QUANTILES[name]))) for name, values in found.items()}
    # Half-way, as ratios go, between the structures that pass and those that do not.
    passing = float(np.quantile([one.disagreement for one in matched], 0.95))
    failing = float(np.quantile([one.disagreement for one in own if np.isfinite(one.disagreement)], 0.05))
    return {"largest_disagreement": round(float(np.sqrt(passing * failing)), 1), **fitted}


def fitted_names() -> tuple[str, ...]:
    """Return the names of the rules that are fitted."""
    return tuple(one.name for one in fields(DecisionRules) if one.metadata["set"] == "fitted")


def write_rules(path: Path, values: Mapping[str, float], provenance: Mapping[str, Any]) -> None:
    """Write fitted rules, each with its provenance; those that other commands fit stay as they are.

    Raises:
        ValueError: a rule is none that is fitted.
    """
    if not set(values) <= set(fitted_names()):
        raise ValueError(f"fitted rules are {', '.join(fitted_names())}; given were {', '.join(values)}")
    meanings = {one.name: one.metadata["meaning"] for one in fields(DecisionRules)}
    document = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    document |= {name: {"value": values[name], "meaning": meanings[name], **provenance} for name in values}
    path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


def table(rules: DecisionRules) -> list[tuple[str, float, str, str]]:
    """Return (name, value, chosen or fitted, meaning) of every rule."""
    values = asdict(rules)
    return [(one.name, values[one.name], one.metadata["set"], one.metadata["meaning"]) for one in fields(rules)]


def _folded(
    groups: Sequence[Sequence[tuple[Family, Telemetry]]], known: Sequence[Sequence[LogLikelihood]], count: int
) -> list[tuple[Family, Telemetry, Sequence[Direction]]]:
    """Return every log with the directions of the groups that are not in its fold."""
    jobs: list[tuple[Family, Telemetry, Sequence[Direction]]] = []
    for turn in range(FOLDS):
        learned = [log for number, logs in enumerate(known) if number % FOLDS != turn for log in logs]
        directions = factor_analysis.learn_directions(learned, count)
        jobs += [(family, log, directions) for group in groups[turn::FOLDS] for family, log in group]
    return jobs


def _told(what: str, gains: Iterable[Gains]) -> list[Gains]:
    """Return all gains, and say how far they are on the way."""
    found = []
    for one in gains:
        found.append(one)
        print(f"{what}: log {len(found)}", file=sys.stderr)
    return found


def _home_logs(family: Family) -> list[tuple[Family, Telemetry]]:
    return [(family, log) for log in simulate(family, MONTH)]


def main(processes: int) -> int:
    """Print the bounds beside those in force, and write them into the package."""
    known = families(processes)
    places: list[VirtualGreenhouse] = list(others(PLACES, PLACES_SEED).values())
    with Jobs("diagnosis rules", processes) as jobs:
        home = _folded(list(jobs.each(_home_logs, known)), list(jobs.each(at_home, known)), DEFAULT.nuisance_directions)
        away = _folded(
            list(jobs.each(transferred_logs, places)),
            list(jobs.each(transferred, places)),
            DEFAULT.nuisance_directions_transferred,
        )
        own_structure = [(known[0], log, MATCHED_SEED + number) for number, (_, log, _) in enumerate(home[:40])]
        print(f"{len(home)}, {len(away)} and {len(own_structure)} logs", file=sys.stderr)
        own = _told("at home", jobs.each(gains_of, home))
        other = _told("transferred", jobs.each(gains_of, away))
        matched = _told("of the simulator's structure", jobs.each(matched_gains, own_structure))
    fitted = bounds(own, other, matched)
    for name, before, _, meaning in table(DEFAULT):
        if name in fitted:
            print(f"{name:28} {before:8g} -> {fitted[name]:8g}   {meaning}")
    seeds = {"home": [one.seed for one in known], "transferred": PLACES_SEED, "matched": MATCHED_SEED}
    write_rules(RULES, fitted, provenance(COMMAND, seeds))
    print(f"wrote {RULES}")
    return 0


def show() -> int:
    """Print every rule with its value, whether it was chosen or fitted, and its meaning."""
    for name, value, how, meaning in table(DEFAULT):
        print(f"{name:30} {value:8g}  {how:7} {meaning}")
    print()
    for name, one in json.loads(RULES.read_text(encoding="utf-8")).items():
        source = one.get("source") or f"seeds {one.get('seeds')}"
        print(f"{name}: {one['command'] or 'no command'}, {one['date']}; {source}")
    return 0
