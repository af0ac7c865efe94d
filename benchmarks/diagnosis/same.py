"""The same greenhouse later: what has changed in it since its calibration.

Every greenhouse is calibrated on eight weeks of its own. Then its crop has grown on, each of its parameters has drifted
by a little, and in some cases its cover was cleaned or its disturbances are others: nothing of that is a finding. Each
log is diagnosed twice, by the greenhouse's history and by what greenhouses show in general.
"""

from __future__ import annotations

import json
import sys
from argparse import Namespace
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, replace

import numpy as np

from benchmarks.diagnosis.cases import FORMS, Case, Turn, hidden
from benchmarks.diagnosis.greenhouses import OTHERS_SEED, VirtualGreenhouse, of_seasons, others
from benchmarks.diagnosis.logs import Reference, disturbances, reference
from benchmarks.diagnosis.scoring import Outcome, judge
from igrow.core.effects import EFFECTS
from igrow.core.greenhouse import GreenhouseParameters, recipe, simulate_many
from igrow.core.greenhouse.tomato import Crop
from igrow.core.greenhouse.uncatalogued import UNCATALOGUED
from igrow.core.telemetry import Telemetry
from igrow.trainer.diagnosis import DEFAULT

DRIFT = 0.015
"""Relative deviation of every plant parameter from its value at the calibration."""
CLEANED = 1.06
"""What a cleaned cover lets through, over before."""
CASES, DAYS = 60, 28
SEEDS = {"tuning": 200_000, "scoring": 300_000}
OTHERS = {"tuning": 70_000, "scoring": OTHERS_SEED}
GROUPS = (
    ("nothing", 0.0, 0.13), ("noise", 0.0, 0.06), ("clean", 0.0, 0.06), ("single", 3.0, 0.1), ("single", 1.0, 0.25),
    ("single", 0.3, 0.12), ("onset", 1.5, 0.1), ("pair", 1.5, 0.06), ("outside", 3.0, 0.06), ("outside", 1.0, 0.06),
)  # fmt: skip
"""Group, ENR and share of the cases."""
RULES = {"history": replace(DEFAULT, history=True), "in general": replace(DEFAULT, history=False)}
CONFOUNDED = ({"co2_valve_leak", "soil_respiration"},)
"""Effects that no log tells apart."""


def draw(kind: str, count: int, units: Mapping[str, Mapping[str, float]]) -> list[Case]:
    """Draw cases; arguments as in `cases.draw`."""
    rng = np.random.default_rng(SEEDS[kind])
    turn, beyond = Turn(rng, list(EFFECTS)), Turn(rng, list(UNCATALOGUED))
    greenhouses = list(units)
    cases: list[Case] = []
    for group, size, share in GROUPS:
        for _ in range(max(1, round(share * count))):
            number = len(cases)
            greenhouse = greenhouses[number % len(greenhouses)]
            causes: tuple[str, ...] = ()
            if size:
                causes = ((beyond if group == "outside" else turn).next(units[greenhouse], ()),)
            if group == "pair":
                causes = (*causes, turn.next(units[greenhouse], causes))
            cases.append(
                Case(
                    name=f"{kind}-{group}-{number:03d}",
                    group=group,
                    greenhouse=greenhouse,
                    seed=SEEDS[kind] + number,
                    causes=causes,
                    size=size,
                    forms=tuple(FORMS[kind][int(rng.integers(len(FORMS[kind])))] for _ in causes),
                    onset_day=float(rng.uniform(7.0, 20.0)) if group == "onset" else None,
                    heavy_tails=bool(rng.random() < 0.5),
                    wrong_noise=group == "noise",
                )
            )
    return cases


def later_logs(known: Reference, cases: Sequence[Case], days: int) -> list[Telemetry]:
    """Simulate all cases of a greenhouse as one batch: the greenhouse itself, some time after its calibration."""
    if not cases:
        return []
    start, count = known.greenhouse.start, len(cases)
    end = start + np.timedelta64(days, "D")
    seasons = simulate_many(
        [later(known.greenhouse, case) for case in cases],
        [known.greenhouse.weather(start, end, case.seed) for case in cases],
        recipe,
        start,
        end,
        count=count,
        seed=cases[0].seed,
        effects=[hidden(case, known.unit, start) for case in cases],
        disturbances=[disturbances(case) for case in cases],
        crop=Crop(*(np.repeat(part, count, axis=-1) for part in known.crop)),
    )
    return [one.measured for one in seasons]


def later(greenhouse: VirtualGreenhouse, case: Case) -> GreenhouseParameters:
    """Return the greenhouse as it is when the log of a case is taken."""
    plant = greenhouse.plant.varied(np.random.default_rng(case.seed), relative=DRIFT)
    if case.group != "clean":
        return plant
    return replace(plant, cover_transmission=plant.cover_transmission * CLEANED)


def table(outcomes: Sequence[Outcome]) -> list[tuple[str, float, int, str]]:
    """Return rows (what, figure, cases, bound)."""

    def share(what: str, chosen: Sequence[Outcome], right: Callable[[Outcome], bool], bound: str) -> None:
        rows.append((what, float(np.mean([right(one) for one in chosen])) if chosen else np.nan, len(chosen), bound))

    def of(*groups: str, size: float | None = None) -> list[Outcome]:
        return [one for one in outcomes if one.case.group in groups and (size is None or one.case.size == size)]

    rows: list[tuple[str, float, int, str]] = []
    for group, what in (("nothing", "nothing missing"), ("noise", "wrong noise"), ("clean", "a cleaned cover")):
        share(f"false claims, {what}", of(group), lambda one: one.verdict != "nothing", "<= .02")
    for size, bound in ((3.0, "-"), (1.0, ">= .80"), (0.3, ">= .35")):
        share(f"right cause first, ENR {size:g}", of("single", size=size), is_first, bound)
    named = [one for one in of("single", "onset") if one.confounded]
    share("right cause first, where a name was given", named, is_first, ">= .95")
    share("a pattern in place of a cause", of("single", "onset"), lambda one: one.verdict == "unexplained", "-")
    share("both of a pair", of("pair"), lambda one: set(one.case.causes) <= set(one.found), ">= .45")
    sizes = [abs(one.relative_size - 1.0) for one in outcomes if one.relative_size is not None]
    rows.append(("size, median relative error", float(np.median(sizes)) if sizes else np.nan, len(sizes), "<= .10"))
    covered = [one for one in outcomes if one.covered is not None]
    share("90 % intervals that cover", covered, lambda one: bool(one.covered), ".85 to .95")
    begun = [one for one in of("onset") if one.onset_error is not None]
    share("beginning within 2 days, where found", begun, lambda one: (one.onset_error or 0.0) <= 2.0, ">= .90")
    share("outside the catalogue: wrong name", of("outside"), lambda one: bool(one.confounded), "<= .05")
    share("outside the catalogue: silence", of("outside"), lambda one: one.verdict == "nothing", "<= .30")
    caused = of("single", "onset", "pair")
    possible = sum(max(one.recalibrated - one.perfect, 0.0) for one in caused)
    gained = sum(one.recalibrated - one.corrected for one in caused)
    rows.append(("recoverable error recovered", gained / possible if possible else np.nan, len(caused), ">= .85"))
    rows.append(("seconds a log, median", float(np.median([one.seconds for one in outcomes])), len(outcomes), "-"))
    return rows


def is_first(one: Outcome) -> bool:
    """Tell whether the first name is a true cause, or one that no log tells apart from it."""
    return bool(one.found) and any(
        one.found[0] == cause or any({one.found[0], cause} <= pair for pair in CONFOUNDED) for cause in one.case.causes
    )


def _judge(job: tuple[Case, Telemetry, Reference]) -> dict[str, Outcome]:
    return {name: judge(*job, rules) for name, rules in RULES.items()}


def main(options: Namespace) -> int:
    """Print both tables side by side."""
    kind = "tuning" if options.tuning else "scoring"
    every = {**of_seasons(), **others(8, OTHERS[kind])}
    greenhouses = dict(list(every.items())[: options.greenhouses])
    outcomes: list[dict[str, Outcome]] = []
    with ProcessPoolExecutor(options.processes) as pool:
        print(f"calibrating {', '.join(greenhouses)}", file=sys.stderr)
        references = dict(zip(greenhouses, pool.map(reference, greenhouses.values()), strict=True))
        cases = draw(kind, options.cases or CASES, {name: one.unit for name, one in references.items()})
        own = {name: [case for case in cases if case.greenhouse == name] for name in greenhouses}
        print(f"simulating {len(cases)} logs", file=sys.stderr)
        logs = pool.map(later_logs, references.values(), own.values(), [options.days] * len(own))
        jobs = [
            (case, log, references[name])
            for name, found in zip(own, logs, strict=True)
            for case, log in zip(own[name], found, strict=True)
        ]
        for number, one in enumerate(pool.map(_judge, jobs), 1):
            outcomes.append(one)
            case = one["history"].case
            said = "; ".join(f"{name}: {told.verdict} {told.found}" for name, told in one.items())
            print(f"{number} of {len(jobs)}: {case.name} {case.causes} {case.size:g} -> {said}", file=sys.stderr)
    if options.json:
        lines = [json.dumps({name: asdict(told) for name, told in one.items()}) + "\n" for one in outcomes]
        options.json.write_text("".join(lines), encoding="utf-8")
    print(f"{len(outcomes)} logs of {len(greenhouses)} greenhouses, {options.days} days, {kind} seeds")
    tables = [table([one[name] for one in outcomes]) for name in RULES]
    print(f"{'':50} {'history':>9} {'in general':>11} {'cases':>12}  bound of the history")
    for (what, figure, count, bound), (_, general, other, _) in zip(*tables, strict=True):
        print(f"{what:50} {figure:9.2f} {general:11.2f} {f'{count}, {other}':>12}  {bound}")
    return 0
