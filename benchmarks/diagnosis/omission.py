"""Terms of the physics taken out of the model before its calibration: does the calibration log name them?

Every greenhouse of a nursery is calibrated on its own weeks with the whole model, and then with one term after the
other taken out: its parameter is held at its lowest value, and all others are fitted without it. A name with the
whole model is a false claim. With `--tuning` it is learned by how much a term makes unseen weeks better where nothing
was taken out, from seeds that no benchmark has. With a folder of data the same is asked of the public logs.
"""

from __future__ import annotations

import json
import sys
from argparse import Namespace
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.diagnosis import real
from benchmarks.diagnosis.cases import SEASONS
from benchmarks.diagnosis.naming import is_same
from benchmarks.diagnosis.nurseries import calibration_logs, nursery
from benchmarks.diagnosis.rules import RULES, write_rules
from benchmarks.jobs import Jobs
from benchmarks.provenance import provenance
from igrow.core.effects import EFFECTS
from igrow.core.simulator.hybrid.parameters import PARAMETERS
from igrow.core.simulator.hybrid.record import Record
from igrow.core.site import Site
from igrow.trainer.data import prepare_log
from igrow.trainer.data.splits import held_out_weeks
from igrow.trainer.diagnosis import DEFAULT
from igrow.trainer.diagnosis.rules import DecisionRules
from igrow.trainer.diagnosis.search import omission
from igrow.trainer.fit.climate import fit_climate, site_prior
from igrow.trainer.fit.evaluation import evaluate
from igrow.trainer.fit.gaussian import Gaussian
from igrow.trainer.fit.solver import DivergenceError

COMMAND = "python -m benchmarks.diagnosis omission --tuning"
SEEDS = {"tuning": 510_000, "scoring": 610_000}
"""Of the first nursery; each season's are ten thousand on."""
GREENHOUSES = 3
"""In a nursery."""
TAKEN_OUT = {
    parameter: effect.name
    for effect in EFFECTS.values()
    for parameter in effect.resembles
    # A screen's gap takes away from what a screen saves: no gap stands in for a screen that saves nothing.
    if effect.name != "screen_gap"
}
"""Parameters that are taken out, and the effect that is then missing."""
ON_REAL_LOGS = ("lamp_heat_share", "leakage_wind", "transpiration_night_share")
"""Parameters that are taken out on the public logs."""
MATTERS = 1.05
"""Times by which the 24 h error of held-out weeks must rise for a term to count as one that the greenhouse has."""
FALSE_CLAIMS = 0.02
"""Of calibrations in which nothing was taken out."""
ANY = replace(DEFAULT, least_omission_fall=0.0, most_causes=1)
"""Under which that term is named which makes unseen weeks better at all."""
HELD = 1e-6
"""Relative standard deviation of a parameter that is held."""


@dataclass(frozen=True)
class Told:
    """One calibration."""

    greenhouse: str
    taken_out: str
    """The effect that is missing; empty for none."""
    named: tuple[str, ...]
    """Causes, that which stands out most first."""
    fall: float
    """By which share they lessen the 24 h error of unseen weeks."""
    rise: float
    """Of the 24 h error on held-out weeks, over that of the whole model: mean ratio of all quantities."""


def without(prior: Gaussian, parameter: str) -> Gaussian:
    """Return a prior that holds a parameter at the lowest value that it may have."""
    place = prior.names.index(parameter)
    mean, deviation = prior.mean.copy(), prior.standard_deviation.copy()
    mean[place] = PARAMETERS[parameter].low
    deviation[place] = HELD * PARAMETERS[parameter].value
    return Gaussian(prior.names, mean, np.diag(deviation**2))


def calibrations(
    record: Record, site: Site, name: str, taken_out: Sequence[str], rules: DecisionRules
) -> Iterator[Told]:
    """Calibrate with the whole model, then with each parameter taken out, and say what each calibration names."""
    prior, held_out = site_prior(site), held_out_weeks(record.time)
    whole = None
    for parameter in ("", *taken_out):
        known = without(prior, parameter) if parameter else prior
        try:
            posterior = fit_climate([(record, None)], known)
            found = omission.examine(record, site, posterior, rules)
        except DivergenceError as error:
            print(f"{name} without {parameter or 'nothing'}: {error}", file=sys.stderr)
            continue
        errors = {
            quantity: by_horizon[omission.DAY].mae
            for quantity, by_horizon in evaluate(record, posterior.values, {}, (omission.DAY,), held_out).items()
        }
        whole = whole or errors
        yield Told(
            name,
            TAKEN_OUT.get(parameter, ""),
            () if found is None else tuple(effect.name for effect in found.effects),
            0.0 if found is None else omission.fall(found.errors),
            float(np.mean([errors[quantity] / whole[quantity] for quantity in errors])),
        )


def season(job: tuple[str, str, int, tuple[str, ...]]) -> list[Told]:
    """Simulate the nursery of a season and calibrate its greenhouses."""
    kind, name, count, taken_out = job
    known = nursery(name, count, SEEDS[kind] + 10_000 * list(SEASONS).index(name))
    rules = ANY if kind == "tuning" else DEFAULT
    told: list[Told] = []
    for greenhouse, (log, _) in zip(known.greenhouses, calibration_logs(known), strict=True):
        seen = prepare_log(log, greenhouse.site)
        record = seen.record(seen.best_shift(site_prior(greenhouse.site).values))
        for one in calibrations(record, greenhouse.site, greenhouse.site.name, taken_out, rules):
            told.append(one)
            names = ", ".join(one.named) or "-"
            print(f"{one.greenhouse} without {one.taken_out or 'nothing'}: {names}", file=sys.stderr)
    return told


def is_right(one: Told) -> bool:
    """Tell whether what was taken out is among the names."""
    return any(is_same(name, one.taken_out) for name in one.named)


def is_wrong(one: Told) -> bool:
    """Tell whether something else is."""
    return any(not is_same(name, one.taken_out) for name in one.named)


def show(told: Sequence[Told]) -> None:
    """Print the table."""
    whole = [one for one in told if not one.taken_out]
    false = [one for one in whole if one.named]
    print(f"named with the whole model: {len(false)} of {len(whole)} {[', '.join(one.named) for one in false]}")
    print(f"{'taken out':24}{'named':>8}{'wrong':>8}{'of':>5}   where the error rises by a twentieth: named   of")
    for effect in (*dict.fromkeys(one.taken_out for one in told if one.taken_out), "all"):
        own = [one for one in told if one.taken_out and effect in {one.taken_out, "all"}]
        matter = [one for one in own if one.rise >= MATTERS]
        wrong = sum(map(is_wrong, own))
        right, mattering = sum(map(is_right, own)), sum(map(is_right, matter))
        shares = f"{right / len(own):8.2f}{wrong:8}{len(own):5}"
        print(f"{effect:24}{shares}{mattering / max(len(matter), 1):45.2f}{len(matter):5}")


def learned(told: Sequence[Told]) -> float:
    """Return the share of unseen weeks' error that a term must remove: more than in nearly all that lack nothing."""
    falls = sorted(one.fall for one in told)
    print(f"falls where nothing was taken out: {', '.join(f'{100.0 * one:.1f} %' for one in falls)}")
    return round(float(np.quantile(falls, 1.0 - FALSE_CLAIMS)), 3)


def on_real_logs(data: Path, only: str) -> int:
    """Print what is named in the calibration logs of the public data sets, with and without each term."""
    told: list[Told] = []
    for one in real.compartments(data):
        if only not in one.name:
            continue
        site = one.site
        record = one.before.record(one.before.best_shift(site_prior(site).values))
        for found in calibrations(record, site, one.name, ON_REAL_LOGS, DEFAULT):
            told.append(found)
            missing, names = found.taken_out or "nothing", ", ".join(found.named) or "-"
            errors = f"error x {found.rise:.2f}, beside what was named x {1.0 - found.fall:.2f}"
            print(f"{one.name:24} without {missing:22} {names:40} {errors}")
    print()
    show(told)
    return 0


def main(options: Namespace) -> int:
    """Learn, or judge greenhouses or public logs."""
    if options.data is not None:
        return on_real_logs(options.data, options.compartment)
    kind = "tuning" if options.tuning else "scoring"
    taken_out = () if options.tuning else tuple(TAKEN_OUT)
    count, told = options.greenhouses or GREENHOUSES, list[Told]()
    with Jobs("diagnosis omission", options.processes) as jobs:
        for found in jobs.each(season, [(kind, name, count, taken_out) for name in options.season or list(SEASONS)]):
            told += found
    if options.json:
        options.json.write_text("".join(json.dumps(asdict(one)) + "\n" for one in told), encoding="utf-8")
    if not options.tuning:
        show(told)
        return 0
    least = learned(told)
    seeds = {name: SEEDS["tuning"] + 10_000 * place for place, name in enumerate(SEASONS)}
    write_rules(RULES, {"least_omission_fall": least}, provenance(COMMAND, seeds))
    print(f"least fall {least:g}; wrote {RULES}")
    return 0
