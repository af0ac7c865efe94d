"""The same diagnosis on greenhouses of the simulator's own structure: what silence is the model's, what the log's.

The plant is the hybrid stage itself with every parameter 8 % off, under the weather and the actuators of a mechanistic
greenhouse's logs, with coloured disturbances and sensor noise, effects of the catalogue's form. The actuators do not
answer what happens here: there is no closed loop.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from benchmarks.diagnosis.cases import REACHABLE, Case
from benchmarks.diagnosis.greenhouses import of_seasons
from benchmarks.diagnosis.logs import MISMATCH, Reference, reference, simulate_cases
from benchmarks.jobs import Jobs
from igrow.core.arrays import Floats
from igrow.core.effects import EFFECTS
from igrow.core.simulator.hybrid.nominal import site_record
from igrow.core.simulator.hybrid.parameters import PARAMETERS
from igrow.core.simulator.hybrid.record import free_run, observe
from igrow.core.telemetry import Telemetry, to_grid
from igrow.trainer.data import prepare_log
from igrow.trainer.diagnosis import diagnose
from igrow.trainer.diagnosis.knowledge import ActiveTerm, activate
from igrow.trainer.fit import FittedModel

STEP = 900.0
"""Seconds between rows of the logs."""
SEASON, DAYS, SEED = "winter", 28, 9500
NOTHING = 40
SIZES = (1.0, 0.3)
SITE = of_seasons()[SEASON].site
HEAT, VAPOUR, CO2, CORRELATION_HOURS = 4.0, 4.0, 0.25, 2.0
"""Disturbances: standard deviations in W m-2, g m-2 h-1 and g m-2 h-1, and the time in which they fade to 1/e."""
NOISE = {"air_temperature": 0.1, "air_humidity": 0.6, "air_co2": 8.0}
"""Of the sensors: K, %, ppm."""


def matched_log(
    driven: Telemetry, model: FittedModel, terms: Sequence[ActiveTerm], rng: np.random.Generator
) -> Telemetry:
    """Return a log of 15 min in which the hybrid stage, 8 % off, is the greenhouse.

    Args:
        driven: log whose weather and actuators are taken.
        model: that it is 8 % off from.
        terms: what is hidden in it.
        rng: for parameters, disturbances and noise.
    """
    coarse = to_grid(driven, int(STEP))
    record = site_record(coarse, SITE, STEP)
    plant = {
        name: float(np.clip(value * (1.0 + MISMATCH * rng.normal()), PARAMETERS[name].low, PARAMETERS[name].high))
        for name, value in model.posterior.values.items()
    }
    effects = activate(record, terms)
    count = len(record)
    added = {
        "heat": _coloured(rng, count, HEAT),
        "vapour": _coloured(rng, count, VAPOUR / 3.6e6),
        "co2": _coloured(rng, count, CO2 / 3.6e6),
    }
    shown = free_run(record, observe(record, plant, effects), np.array([0]), count - 1, plant, effects, added)
    measured = {
        name: np.concatenate([record.measured[name][:1], shown[name][:, 0]]) + NOISE[name] * rng.normal(size=count)
        for name in record.measured
    }
    return coarse.with_columns(measured)


def _coloured(rng: np.random.Generator, count: int, size: float) -> Floats:
    """Return an autoregressive process of first order of standard deviation `size`, (count,)."""
    left = float(np.exp(-STEP / (3600.0 * CORRELATION_HOURS)))
    course = np.empty(count)
    value = size * rng.normal()
    for row, innovation in enumerate(size * np.sqrt(1.0 - left**2) * rng.normal(size=count)):
        value = left * value + innovation
        course[row] = value
    return course


def _judge(job: tuple[int, Telemetry, FittedModel, str, float]) -> tuple[str, float, str, tuple[str, ...]]:
    seed, driven, model, cause, amplitude = job
    shape = {one.name: one.typical for one in EFFECTS[cause].shapes} if cause else {}
    terms = (ActiveTerm(cause, amplitude, shape),) if cause else ()
    log = matched_log(driven, model, terms, np.random.default_rng(seed))
    diagnosis = diagnose(prepare_log(log, SITE), model)
    return cause, amplitude, diagnosis.verdict, tuple(one.effect for one in diagnosis.findings)


def _jobs(known: Reference) -> list[tuple[int, Telemetry, FittedModel, str, float]]:
    drivers = [Case(f"matched-{index}", "nothing", SEASON, SEED + index) for index in range(20)]
    logs = simulate_cases(known, drivers, DAYS)
    # The actuators are read as they stand, and the calibration's discrepancy is the mechanistic greenhouse's own.
    model = replace(known.model, discrepancy={}, alignment=0.0)
    seen = [name for name, effect in EFFECTS.items() if REACHABLE * known.unit[name] <= abs(effect.amplitude.high)]
    wanted = [("", 0.0)] * NOTHING + [(name, size * known.unit[name]) for size in SIZES for name in seen]
    return [
        (SEED + 1000 + index, logs[index % len(logs)], model, cause, amplitude)
        for index, (cause, amplitude) in enumerate(wanted)
    ]


def main(processes: int) -> int:
    """Print the table."""
    known = reference(of_seasons()[SEASON])
    wanted = _jobs(known)
    outcomes = []
    with Jobs("diagnosis matched", processes) as jobs:
        for number, outcome in enumerate(jobs.each(_judge, wanted), 1):
            outcomes.append(outcome)
            cause, _, verdict, found = outcome
            print(f"{number} of {len(wanted)}: {cause or 'nothing'} -> {verdict} {found}", file=sys.stderr)
    print(f"{len(outcomes)} greenhouses of the simulator's own structure, {DAYS} days, {SEASON}, seeds from {SEED}")
    claims = [verdict != "nothing" for cause, _, verdict, _ in outcomes if not cause]
    print(f"{'false claims on nothing':28} {np.mean(claims):5.2f} {len(claims):5d}")
    for size in SIZES:
        chosen = [one for one in outcomes if one[0] and np.isclose(one[1], size * known.unit[one[0]])]
        right = [bool(found) and found[0] == cause for cause, _, _, found in chosen]
        silent = [verdict == "nothing" for _, _, verdict, _ in chosen]
        title = f"right cause first, ENR {size:g}"
        print(f"{title:28} {np.mean(right):5.2f} {len(right):5d}   silent {np.mean(silent):.2f}")
    return 0
