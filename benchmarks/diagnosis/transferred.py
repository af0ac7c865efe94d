"""Greenhouses that no calibration has shown, asked by a neighbour's model and by the built-in bundle.

Greenhouses stand anywhere, their logs begin in any month. Of each the model of a neighbour is known, whose every
parameter is another one (log-normal, 8 %), calibrated on eight weeks of the neighbour's. By the built-in bundle the
site's description alone is known. Cases and logs are the same for both.
"""

from __future__ import annotations

import json
import sys
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import asdict, replace

from benchmarks.diagnosis import figures
from benchmarks.diagnosis.cases import Case, draw
from benchmarks.diagnosis.figures import Row
from benchmarks.diagnosis.greenhouses import others
from benchmarks.diagnosis.logs import Reference, built_in, reference, simulated_cases
from benchmarks.diagnosis.scoring import Outcome, judged
from benchmarks.jobs import Jobs
from igrow.core.telemetry import Telemetry
from igrow.trainer.diagnosis.learned.null_gains import read_unknown_gains

CASES, GREENHOUSES, DAYS = 72, 8, 28
SEED, CASES_SEED = 290_000, 295_000
"""Of the first greenhouse, and of the cases."""
GROUPS = (
    ("nothing", 0.0, 0.2), ("noise", 0.0, 0.05), ("single", 3.0, 0.12), ("single", 1.0, 0.25), ("single", 0.3, 0.12),
    ("onset", 1.5, 0.1), ("pair", 1.5, 0.06), ("outside", 3.0, 0.05), ("outside", 1.0, 0.05),
)  # fmt: skip
"""Group, ENR and share of the cases."""
MODELS = {"neighbour's": "of a neighbour, 8 % off in every parameter", "built-in": "the built-in bundle"}
Asked = tuple[Case, Telemetry, Reference]
"""A case, its log, and its greenhouse with the model that it is asked by."""


def by_each(case: Case, log: Telemetry, neighbour: Reference) -> dict[str, Asked]:
    """Return a log as it is asked by each of the models."""
    here = replace(neighbour.greenhouse.site, name=f"{neighbour.greenhouse.site.name}-beside")
    beside = replace(neighbour, greenhouse=replace(neighbour.greenhouse, site=here))
    models = dict(zip(MODELS, (replace(neighbour.model, site=here), built_in(here)), strict=True))
    return {name: (case, log, replace(beside, model=model)) for name, model in models.items()}


def table(outcomes: Sequence[Outcome]) -> list[Row]:
    """Return all figures."""
    return [
        *figures.false_claims(outcomes),
        *figures.names(outcomes),
        *figures.oracle(outcomes, read_unknown_gains()),
        *figures.estimates(outcomes),
    ]


def main(options: Namespace) -> int:
    """Print the table."""
    neighbours: dict[str, Reference] = {}
    outcomes: dict[str, list[Outcome]] = {name: [] for name in MODELS}
    with Jobs("diagnosis transferred", options.processes) as jobs:
        for one in jobs.each(reference, others(GREENHOUSES, SEED).values()):
            neighbours[one.greenhouse.site.name] = one
            print(f"{len(neighbours)} of {GREENHOUSES} calibrated", file=sys.stderr, flush=True)
        units = {name: one.unit for name, one in neighbours.items()}
        cases = draw("scoring", CASES_SEED, options.cases or CASES, units, GROUPS)
        own = [[case for case in cases if case.greenhouse == name] for name in neighbours]
        logs = jobs.each(
            simulated_cases, [(one, mine, DAYS) for one, mine in zip(neighbours.values(), own, strict=True)]
        )
        asked = [
            by_each(case, log, one)
            for one, mine, seen in zip(neighbours.values(), own, logs, strict=True)
            for case, log in zip(mine, seen, strict=True)
        ]
        wanted = [(name, one[name]) for name in MODELS for one in asked]
        judgements = jobs.each(judged, [one for _, one in wanted])
        for number, ((name, _), outcome) in enumerate(zip(wanted, judgements, strict=True), 1):
            outcomes[name].append(outcome)
            case = outcome.case
            said = f"{case.name} {case.causes} {case.size:g}, {name} -> {outcome.verdict} {outcome.found}"
            print(f"{number} of {len(wanted)}: {said}", file=sys.stderr, flush=True)
    if options.json:
        every = [asdict(one) | {"model": name} for name, own_ones in outcomes.items() for one in own_ones]
        options.json.write_text("".join(json.dumps(one) + "\n" for one in every), encoding="utf-8")
    print(f"{len(cases)} logs of {GREENHOUSES} greenhouses, {DAYS} days, each by two models:")
    print("\n".join(f"  {name:12} {about}" for name, about in MODELS.items()))
    print(f"\n{'':64}" + "".join(f"{name:>14} {'cases':>6}" for name in MODELS))
    for rows in zip(*map(table, outcomes.values()), strict=True):
        if any(row.cases for row in rows):
            print(f"{rows[0].what:64}" + "".join(f"{row.value:14.2f} {row.cases:6}" for row in rows))
    return 0
