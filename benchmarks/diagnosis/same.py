"""The same greenhouse later: what has changed in it since its calibration.

Every greenhouse is calibrated on eight weeks of its own. Then its crop has grown on, each of its parameters has drifted
by a little, and in some cases its cover was cleaned or its disturbances are others: nothing of that is a finding.
Greenhouses stand in nurseries, one a season, and have seeds that nothing was learned or tuned on.
"""

from __future__ import annotations

import itertools
import json
import sys
from argparse import Namespace
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict

import numpy as np

from benchmarks.diagnosis.cases import CHANGES, FORMS, SEASONS, Case, Turn
from benchmarks.diagnosis.logs import Reference
from benchmarks.diagnosis.makers import FOREIGN, OWN
from benchmarks.diagnosis.nurseries import calibrated, calibration_logs, later, later_logs, nursery
from benchmarks.diagnosis.scoring import Outcome, has_all, is_first, judge
from benchmarks.jobs import Jobs
from igrow.core.effects import EFFECTS
from igrow.core.greenhouse.uncatalogued import UNCATALOGUED
from igrow.core.telemetry import Telemetry
from igrow.trainer.diagnosis.learned.null_gains import read_null_gains

CASES, DAYS = 60, 28
SEEDS = {"tuning": 200_000, "scoring": 900_000}
"""Of the first nursery; each season's are ten thousand on."""
FOREIGN_SEEDS = {"tuning": 700_000, "scoring": 800_000}
"""The same of greenhouses of another structure."""
GREENHOUSES = 6
"""In a nursery."""
GROUPS = (
    ("nothing", 0.0, 0.13), ("noise", 0.0, 0.06), ("clean", 0.0, 0.06), ("single", 3.0, 0.1), ("single", 1.0, 0.25),
    ("single", 0.3, 0.12), ("onset", 1.5, 0.1), ("pair", 1.5, 0.06), ("outside", 3.0, 0.06), ("outside", 1.0, 0.06),
    ("parameter", 0.0, 0.2),
)  # fmt: skip
"""Group, ENR and share of the cases."""
MATTERS = 1.1
"""Times the error of a model with the true cause that a recalibrated one makes, from which on the cause matters."""


def draw(kind: str, first: int, count: int, units: Mapping[str, Mapping[str, float]]) -> list[Case]:
    """Draw cases; arguments as in `cases.draw`, and the first seed."""
    rng = np.random.default_rng(first)
    turn, beyond = Turn(rng, list(EFFECTS)), Turn(rng, list(UNCATALOGUED))
    greenhouses = itertools.cycle(units)
    changes = list(CHANGES)
    cases: list[Case] = []
    for group, size, share in GROUPS:
        for place in range(max(1, round(share * count))):
            greenhouse, number = next(greenhouses), len(cases)
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
                    seed=first + 1000 + number,
                    causes=causes,
                    size=size,
                    forms=tuple(FORMS[kind][int(rng.integers(len(FORMS[kind])))] for _ in causes),
                    onset_day=float(rng.uniform(7.0, 20.0)) if group == "onset" else None,
                    heavy_tails=bool(rng.random() < 0.5),
                    wrong_noise=group == "noise",
                    # In every greenhouse another each time round.
                    changed=changes[(place + place // len(units)) % len(changes)] if group == "parameter" else "",
                )
            )
    return cases


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
    alone = of("single", "onset")
    for matters, where in ((True, "errs a tenth more"), (False, "does not")):
        mine = [one for one in alone if (one.recalibrated >= MATTERS * one.perfect) == matters]
        share(f"right first, where recalibration {where}", mine, is_first, "-")
    named = [one for one in alone if one.confounded]
    share("right cause first, where a name was given", named, is_first, ">= .95")
    share("a pattern in place of a cause", alone, lambda one: one.verdict == "unexplained", "-")
    for change, (factor, _) in CHANGES.items():
        mine = [one for one in of("parameter") if one.case.changed == change]
        share(f"right: {change} times {factor:g}", mine, is_first, "-")
    share(
        "a wrong name for a parameter's change",
        of("parameter"),
        lambda one: bool(one.confounded) and not is_first(one),
        "-",
    )
    bounds = read_null_gains()
    for size in (1.0, 0.3):
        seen = [one for one in of("single", size=size) if one.expected_gain is not None]
        right = f"oracle: gain enough at ENR {size:g}, were the structure right"
        share(right, seen, lambda one: (one.expected_gain or 0.0) >= bounds.least, "-")
        known = [one for one in seen if one.known_gain is not None]
        share("oracle: the same, parameters known", known, lambda one: (one.known_gain or 0.0) >= bounds.least, "-")
        own = "oracle: gain enough, by what its effect must gain"
        share(own, seen, lambda one: (one.expected_gain or 0.0) >= bounds.needed(one.case.causes[0]), "-")
    share("both of a pair", of("pair"), has_all, ">= .45")
    sizes = [abs(one.relative_size - 1.0) for one in outcomes if one.relative_size is not None]
    rows.append(("size, median relative error", float(np.median(sizes)) if sizes else np.nan, len(sizes), "<= .10"))
    fluxes = [abs(one.relative_flux - 1.0) for one in outcomes if one.relative_flux is not None]
    rows.append(
        ("what it adds, RMS, median relative error", float(np.median(fluxes)) if fluxes else np.nan, len(fluxes), "-")
    )
    covered = [one for one in outcomes if one.covered is not None]
    share("90 % intervals that cover", covered, lambda one: bool(one.covered), ".85 to .95")
    widths = [one.half_width for one in outcomes if one.half_width is not None]
    rows.append(
        ("half of the interval over the size, median", float(np.median(widths)) if widths else np.nan, len(widths), "-")
    )
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


def prepared(job: tuple[str, str, int, int, int, bool]) -> list[tuple[Case, Telemetry, Reference]]:
    """Simulate and calibrate the nursery of a season; return its cases, their logs, and their greenhouses."""
    kind, season, greenhouses, count, days, foreign = job
    seeds, maker = (FOREIGN_SEEDS, FOREIGN) if foreign else (SEEDS, OWN)
    first = seeds[kind] + 10_000 * list(SEASONS).index(season)
    known = nursery(season, greenhouses, first, maker)
    references: dict[str, Reference] = {}
    for own_log in zip(known.greenhouses, calibration_logs(known), strict=True):
        one = calibrated(own_log)
        references[one.greenhouse.site.name] = one
        print(f"{season}: {len(references)} of {greenhouses} calibrated", file=sys.stderr, flush=True)
    cases = draw(kind, first, count, {name: one.unit for name, one in references.items()})
    own = [[case for case in cases if case.greenhouse == name] for name in references]
    logs = later_logs(list(references.values()), own, days, maker)
    print(f"{season}: {len(cases)} logs", file=sys.stderr, flush=True)
    return [
        (case, log, one)
        for one, mine, seen in zip(references.values(), own, logs, strict=True)
        for case, log in zip(mine, seen, strict=True)
    ]


def judged(job: tuple[Case, Telemetry, Reference]) -> Outcome:
    """Diagnose the log of a greenhouse some time after its calibration, as one job."""
    case, log, known = job
    return judge(case, log, known, later(known.greenhouse, case))


def main(options: Namespace) -> int:
    """Print the table."""
    kind = "tuning" if options.tuning else "scoring"
    seasons = options.season or list(SEASONS)
    greenhouses, count = options.greenhouses or GREENHOUSES, (options.cases or CASES) // len(seasons)
    outcomes: list[Outcome] = []
    with Jobs("diagnosis foreign" if options.foreign else "diagnosis same", options.processes) as jobs:
        wanted = [(kind, season, greenhouses, count, options.days, options.foreign) for season in seasons]
        cases = [case for own in jobs.each(prepared, wanted) for case in own]
        for number, one in enumerate(jobs.each(judged, cases), 1):
            outcomes.append(one)
            case = one.case
            said = f"{case.name} in {case.greenhouse} {case.causes} {case.size:g} -> {one.verdict} {one.found}"
            print(f"{number} of {len(cases)}: {said}", file=sys.stderr, flush=True)
    if options.json:
        options.json.write_text("".join(json.dumps(asdict(one)) + "\n" for one in outcomes), encoding="utf-8")
    print(
        f"{len(outcomes)} logs of {greenhouses * len(seasons)} greenhouses ({', '.join(seasons)}), {options.days} days"
    )
    print(f"{'':64} {'figure':>8} {'cases':>6}  bound")
    for what, figure, of, bound in table(outcomes):
        print(f"{what:64} {figure:8.2f} {of:6}  {bound}")
    print()
    print("by season: false claims; right first at ENR 1")
    for season in seasons:
        mine = [one for one in outcomes if one.case.greenhouse.startswith(season)]
        nothing = [one for one in mine if one.case.group in {"nothing", "noise", "clean"}]
        false = sum(one.verdict != "nothing" for one in nothing)
        right = next((figure, of) for what, figure, of, _ in table(mine) if what == "right cause first, ENR 1")
        print(f"  {season:8} {false} of {len(nothing)}; {right[0]:.2f} of {right[1]}")
    return 0
