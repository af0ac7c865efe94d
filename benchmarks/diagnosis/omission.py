"""Terms of the physics taken out of the model before its calibration: does the calibration log name them?

Every greenhouse of a nursery is calibrated on its own weeks with the whole model, and then with one term after the
other taken out: its parameter is held at its lowest value, and all others are fitted without it. A name with the
whole model is a false claim. With `--tuning` what terms gain where nothing was taken out is learned, from seeds that
no benchmark has. With a folder of data the same is asked of the public logs.
"""

from __future__ import annotations

import json
import sys
from argparse import Namespace
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib.resources import files
from pathlib import Path

import numpy as np

from benchmarks.diagnosis import real
from benchmarks.diagnosis.cases import SEASONS
from benchmarks.diagnosis.nurseries import calibration_logs, nursery
from benchmarks.jobs import Jobs
from benchmarks.provenance import provenance
from igrow.core.effects import EFFECTS
from igrow.core.simulator.hybrid.parameters import PARAMETERS
from igrow.core.simulator.hybrid.record import Record
from igrow.core.site import Site
from igrow.trainer.data import prepare_log
from igrow.trainer.data.splits import held_out_weeks
from igrow.trainer.diagnosis import DEFAULT, omission
from igrow.trainer.diagnosis.omission import TERMS, USUAL_DEVIATION, UsualGains, root_gain
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
CONFOUNDED = ({"co2_valve_leak", "soil_respiration"},)
LEAST, MOST = 3.0, 8.0
"""Scores between which the bound is set."""
FALSE_CLAIMS = 0.02
"""Of calibrations in which nothing was taken out."""
COUNTS_AS = 3.0
"""Greenhouses that the deviation of a root gain before any greenhouse counts as."""
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
    gains: dict[str, float]
    rise: float
    """Of the 24 h error on held-out weeks, over that of the whole model: mean ratio of all quantities."""


def learn(gains: Mapping[str, Sequence[Mapping[str, float]]]) -> dict[str, tuple[float, float]]:
    """Return mean and predictive deviation of the root gain of every term.

    Args:
        gains: by greenhouse, those of its calibrations in which nothing was taken out.
    """
    found = {}
    for effect in TERMS:
        roots = np.array([np.mean([root_gain(one.get(effect, 0.0)) for one in own]) for own in gains.values()])
        count, mean = len(roots), float(roots.mean())
        # An inverse chi-squared prior keeps few greenhouses that happen to agree from counting as all there are.
        variance = (COUNTS_AS * USUAL_DEVIATION**2 + float(np.sum((roots - mean) ** 2))) / (COUNTS_AS + count - 1.0)
        found[effect] = (round(mean, 2), round(float(np.sqrt(variance * (1.0 + 1.0 / count))), 2))
    return found


def without(prior: Gaussian, parameter: str) -> Gaussian:
    """Return a prior that holds a parameter at the lowest value that it may have."""
    place = prior.names.index(parameter)
    mean, deviation = prior.mean.copy(), prior.standard_deviation.copy()
    mean[place] = PARAMETERS[parameter].low
    deviation[place] = HELD * PARAMETERS[parameter].value
    return Gaussian(prior.names, mean, np.diag(deviation**2))


def calibrations(
    record: Record, site: Site, name: str, taken_out: Sequence[str], usual: UsualGains | None
) -> Iterator[Told]:
    """Calibrate with the whole model, then with each parameter taken out, and say what each calibration names.

    Without usual gains nothing is named: what terms gain is all that is asked.
    """
    prior, held_out = site_prior(site), held_out_weeks(record.time)
    whole = None
    for parameter in ("", *taken_out):
        known = without(prior, parameter) if parameter else prior
        try:
            posterior = fit_climate([(record, None)], known)
            gains = omission.gains_of(record, site, posterior, DEFAULT)
        except DivergenceError as error:
            print(f"{name} without {parameter or 'nothing'}: {error}", file=sys.stderr)
            continue
        errors = {
            quantity: by_horizon[omission.DAY].mae
            for quantity, by_horizon in evaluate(record, posterior.values, {}, (omission.DAY,), held_out).items()
        }
        whole = whole or errors
        found = None if usual is None else omission.examine(record, site, posterior, DEFAULT, usual)
        yield Told(
            name,
            TAKEN_OUT.get(parameter, ""),
            () if found is None else tuple(effect.name for effect in found.effects),
            {effect: round(gain, 1) for effect, gain in gains.items()},
            float(np.mean([errors[quantity] / whole[quantity] for quantity in errors])),
        )


def season(job: tuple[str, str, int, tuple[str, ...]]) -> list[Told]:
    """Simulate the nursery of a season and calibrate its greenhouses."""
    kind, name, count, taken_out = job
    known = nursery(name, count, SEEDS[kind] + 10_000 * list(SEASONS).index(name))
    usual = None if kind == "tuning" else omission.read_usual_gains()
    told: list[Told] = []
    for greenhouse, (log, _) in zip(known.greenhouses, calibration_logs(known), strict=True):
        seen = prepare_log(log, greenhouse.site)
        record = seen.record(seen.best_shift(site_prior(greenhouse.site).values))
        for one in calibrations(record, greenhouse.site, greenhouse.site.name, taken_out, usual):
            told.append(one)
            names = ", ".join(one.named) or "-"
            print(f"{one.greenhouse} without {one.taken_out or 'nothing'}: {names}", file=sys.stderr)
    return told


def stands_for(name: str, taken_out: str) -> bool:
    """Tell whether a name is that of what was taken out, or of what no log tells apart from it."""
    return name == taken_out or any({name, taken_out} <= pair for pair in CONFOUNDED)


def is_right(one: Told) -> bool:
    """Tell whether what was taken out is among the names."""
    return any(stands_for(name, one.taken_out) for name in one.named)


def is_wrong(one: Told) -> bool:
    """Tell whether something else is."""
    return any(not stands_for(name, one.taken_out) for name in one.named)


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


def learned(told: Sequence[Told]) -> UsualGains:
    """Return what terms gain in calibrations with the whole model, and the least score, each judged by the others'."""
    gains: dict[str, list[dict[str, float]]] = {}
    for one in told:
        gains.setdefault(one.greenhouse, []).append(one.gains)
    largest = []
    for greenhouse, own in gains.items():
        rest = UsualGains(learn({name: one for name, one in gains.items() if name != greenhouse}), 0.0)
        largest += [max(rest.score(effect, gain) for effect, gain in one.items()) for one in own]
    print(f"largest scores, each by the gains of the others: {', '.join(f'{one:.1f}' for one in sorted(largest))}")
    least = float(np.clip(np.quantile(largest, 1.0 - FALSE_CLAIMS), LEAST, MOST))
    seeds = {name: SEEDS["tuning"] + 10_000 * place for place, name in enumerate(SEASONS)}
    return UsualGains(learn(gains), round(least, 1), provenance(COMMAND, seeds))


def on_real_logs(data: Path, only: str) -> int:
    """Print what is named in the calibration logs of the public data sets, with and without each term."""
    told: list[Told] = []
    for one in real.compartments(data):
        if only not in one.name:
            continue
        site = one.site
        record = one.before.record(one.before.best_shift(site_prior(site).values))
        for found in calibrations(record, site, one.name, ON_REAL_LOGS, omission.read_usual_gains()):
            told.append(found)
            ranked = sorted(found.gains, key=found.gains.__getitem__, reverse=True)[:3]
            gains = ", ".join(f"{name} {found.gains[name]:.0f}" for name in ranked)
            missing, names = found.taken_out or "nothing", ", ".join(found.named) or "-"
            print(f"{one.name:24} without {missing:22} {names:40} error x {found.rise:.2f}; gains {gains}")
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
    usual = learned(told)
    path = Path(str(files("igrow.trainer.diagnosis"))) / omission.FILE
    path.write_text(json.dumps(asdict(usual), indent=1) + "\n", encoding="utf-8")
    print(f"least score {usual.least_score:g}; wrote {path}")
    return 0
