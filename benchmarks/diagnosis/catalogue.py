"""Every cause of the catalogue in turn, in one greenhouse a season: what is told of it, and the error before and after.

The usual greenhouse is calibrated on eight weeks of its own. A week later one cause begins, twice as large as a clearly
visible case of it, and two weeks later the log is diagnosed. First comes a log with nothing in it. Seeds are
those of no other benchmark.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.diagnosis.cases import Case
from benchmarks.diagnosis.figures import MATTERS
from benchmarks.diagnosis.logs import Reference
from benchmarks.diagnosis.nurseries import calibrated, calibration_logs, later_logs, nursery
from benchmarks.diagnosis.scoring import NOISE, Outcome, is_first, judged
from benchmarks.jobs import Jobs
from igrow.core.effects import EFFECTS
from igrow.core.telemetry import Telemetry

SEEDS = {"winter": 150_000, "spring": 160_000, "autumn": 170_000}
SEASONS_USED = ("winter", "spring")
DAYS, BEGINS = 21, 7
TIMES = 2.0
"""A typical amplitude."""
STAGES = {
    "deployed": "as deployed", "recalibrated": "recalibrated", "corrected": "with the cause found",
    "perfect": "the truth known",
}  # fmt: skip
"""Of a model, by what an outcome calls their errors."""


def cases(season: str, greenhouse: str) -> list[Case]:
    """Return the case in which nothing is missing, and one of every cause."""
    first = SEEDS[season] + 500
    found = [Case(f"{season}-nothing", "nothing", greenhouse, first)]
    for number, name in enumerate(EFFECTS, 1):
        found.append(
            Case(
                f"{season}-{name}", "onset", greenhouse, first + number, (name,), TIMES, ((1.0, 0.0, 0.0),),
                onset_day=float(BEGINS),
            )
        )  # fmt: skip
    return found


def prepared(season: str) -> list[tuple[Case, Telemetry, Reference]]:
    """Calibrate the greenhouse of a season, and simulate its cases."""
    known = nursery(season, 1, SEEDS[season])
    (greenhouse,), (log,) = known.greenhouses, calibration_logs(known)
    typical = {name: effect.amplitude.typical for name, effect in EFFECTS.items()}
    one = replace(calibrated((greenhouse, log)), unit=typical)
    own = cases(season, greenhouse.site.name)
    (logs,) = later_logs([one], [own], DAYS)
    return [(case, seen, one) for case, seen in zip(own, logs, strict=True)]


def line(one: Outcome) -> str:
    """Return what was told of a case as a line."""
    (cause,) = one.case.causes or ("nothing",)
    told = ", ".join(one.found) or one.verdict
    if one.verdict == "ambiguous":
        told += " or another"
    size = "" if one.relative_size is None else f"{one.relative_size:.2f}"
    known = one.onset_error is not None and one.onset_error < DAYS
    begun = f"{one.onset_error:.1f}" if known else ""
    errors = " ".join(f"{getattr(one, stage):8.2f}" for stage in STAGES)
    return f"{cause:32} {told:44} {size:>5} {begun:>6}  {errors}"


def rows(outcomes: Sequence[Outcome]) -> list[tuple[str, float, int]]:
    """Return rows (what, figure, cases), of the cases that have a cause."""

    def mean(values: Sequence[float | bool]) -> tuple[float, int]:
        return (float(np.mean(values)) if values else float("nan")), len(values)

    own = [one for one in outcomes if one.case.causes]
    named = [one for one in own if one.confounded]
    seen = [one for one in own if one.recalibrated >= MATTERS * one.perfect]
    sizes = [abs(one.relative_size - 1.0) for one in own if one.relative_size is not None]
    begun = [one.onset_error for one in own if one.onset_error is not None]
    possible = sum(max(one.recalibrated - one.perfect, 0.0) for one in own)
    return [
        ("right cause first", *mean([is_first(one) for one in own])),
        ("the same, where recalibration errs a tenth more", *mean([is_first(one) for one in seen])),
        ("right, where a name is given", *mean([is_first(one) for one in named])),
        ("another name beside a right one", *mean([len(one.found) > 1 for one in named if is_first(one)])),
        ("beginning within 2 days, where found", *mean([days <= 2.0 for days in begun])),
        ("size, median relative error", float(np.median(sizes)) if sizes else float("nan"), len(sizes)),
        ("recoverable error recovered", sum(one.recalibrated - one.corrected for one in own) / possible, len(own)),
    ]


def draw(path: Path, by_season: Mapping[str, Sequence[Outcome]]) -> None:
    """Draw the errors of every stage, one panel a season, the causes from the largest error down."""
    from igrow.trainer.figure_style import name_above, panels  # noqa: PLC0415, only this draws

    figure, axes = panels(len(by_season), 7.2 * len(by_season), width=6.4)
    marks = {"deployed": ("x", "0.5"), "recalibrated": ("s", "C1"), "corrected": ("o", "C0"), "perfect": ("|", "0.0")}
    for panel, (season, outcomes) in zip(axes, by_season.items(), strict=True):
        ordered = sorted((one for one in outcomes if one.case.causes), key=lambda one: one.deployed)
        places = np.arange(len(ordered))
        for stage, (mark, colour) in marks.items():
            values = [getattr(one, stage) for one in ordered]
            size = 70 if mark == "|" else 26
            panel.scatter(values, places, marker=mark, color=colour, s=size, label=STAGES[stage])
        panel.set_yticks(places, [one.case.causes[0] + (" *" if is_first(one) else "") for one in ordered], fontsize=7)
        panel.set_xlim(left=0.0)
        name_above(panel, f"{season}; * named first")
        panel.legend(loc="lower right", fontsize=8, frameon=False)
    axes[-1].set_xlabel("error a day ahead on unseen days (see the table)")
    figure.savefig(path, facecolor="white")


def main(options: Namespace) -> int:
    """Print the table of each season and of all."""
    seasons = options.season or SEASONS_USED
    by_season: dict[str, list[Outcome]] = {season: [] for season in seasons}
    with Jobs("diagnosis catalogue", options.processes) as jobs:
        wanted = [case for own in jobs.each(prepared, seasons) for case in own]
        for number, one in enumerate(jobs.each(judged, wanted), 1):
            by_season[one.case.name.split("-")[0]].append(one)
            print(f"{number} of {len(wanted)}: {one.case.name} -> {one.verdict} {one.found}", file=sys.stderr)
    scales = ", ".join(f"{quantity} over {scale:g}" for quantity, scale in NOISE.items())
    print(f"{TIMES:g} times a typical amplitude from day {BEGINS + 1} on, {DAYS} days; begun: days off")
    print(f"error a day ahead on unseen days, summed: {scales} (K, %, ppm)")
    for season, outcomes in by_season.items():
        print(f"\n{season:32} {'told':44} {'size':>5} {'begun':>6}  deployed recalib.  correct.    truth")
        print("\n".join(map(line, outcomes)))
    print(f"\n{'':50} {'figure':>8} {'cases':>6}")
    for what, figure, count in rows([one for outcomes in by_season.values() for one in outcomes]):
        print(f"{what:50} {figure:8.2f} {count:6d}")
    if options.figure:
        draw(options.figure, by_season)
    return 0
