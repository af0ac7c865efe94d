"""The benchmark's logs: the reference logs that models are calibrated on, and the logs of all cases of a greenhouse."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.diagnosis.cases import Case, hidden
from benchmarks.diagnosis.greenhouses import VirtualGreenhouse
from benchmarks.diagnosis.makers import Plant, State
from igrow.core import sun
from igrow.core.bundle import default_bundle_folder, read_bundle
from igrow.core.effects import EFFECTS
from igrow.core.greenhouse import Disturbances, recipe, simulate_many
from igrow.core.greenhouse.uncatalogued import UNCATALOGUED
from igrow.core.simulator.hybrid.record import Record
from igrow.core.site import Site
from igrow.core.telemetry import Telemetry
from igrow.trainer.calibration import calibrate
from igrow.trainer.data import prepare_log
from igrow.trainer.data.splits import split_days
from igrow.trainer.diagnosis import DEFAULT, history_of
from igrow.trainer.diagnosis.design import freerun, sensitivity
from igrow.trainer.exporting import read_model
from igrow.trainer.fit import FittedModel

REFERENCE_DAYS = 56
MISMATCH = 0.08
"""Relative deviation of every plant parameter from the calibrated greenhouse's."""


@dataclass(frozen=True)
class Reference:
    """A greenhouse, the model in force, and the amplitude of ENR 1 of every cause."""

    greenhouse: VirtualGreenhouse
    model: FittedModel
    unit: dict[str, float]
    state: State
    """At the end of the log that it was calibrated on: where its later logs begin."""


def reference(greenhouse: VirtualGreenhouse) -> Reference:
    """Simulate the unchanged greenhouse for eight weeks, calibrate on them, and measure sizes."""
    start = greenhouse.start - np.timedelta64(REFERENCE_DAYS, "D")
    weather = greenhouse.weather(start, greenhouse.start, greenhouse.seed)
    (log,) = simulate_many(greenhouse.plant, weather, recipe, start, greenhouse.start, count=1, seed=greenhouse.seed)
    return referenced(greenhouse, log.measured, log.crop)


def referenced(greenhouse: VirtualGreenhouse, log: Telemetry, state: State) -> Reference:
    """Calibrate on the log of a greenhouse, and measure sizes; `state` is that at its end."""
    seen = prepare_log(log, greenhouse.site)
    model = calibrate(seen)
    record = seen.record(model.alignment or 0.0)
    if model.history is None:
        # Learned here whether or not it is asked by default.
        model = replace(model, history=history_of(record, model, DEFAULT))
    return Reference(greenhouse, model, enr_units(record, model), state)


def built_in(site: Site) -> FittedModel:
    """Return the model of the built-in bundle, which knows a site's description alone."""
    return read_model(read_bundle(default_bundle_folder()), site)


def enr_units(record: Record, model: FittedModel) -> dict[str, float]:
    """Return, for every cause, the amplitude at which ENR is one on a log without it."""
    site = model.site
    runs = sensitivity.day_runs(record, split_days(record, site.longitude).day)
    line = sensitivity.linearise(record, runs, model.posterior.values, {})
    noise = [freerun.root_mean_square(np.where(w, e, np.nan)) for w, e in zip(runs.weight, line.errors, strict=True)]
    unit = {}
    line = replace(
        line, drivers={**line.drivers, "weekday": 1.0 * sun.weekday(sun.solar_day(record.time, site.longitude))}
    )
    for name, effect in {**EFFECTS, **UNCATALOGUED}.items():
        small = 0.2 * effect.amplitude.typical
        shape = {one.name: one.typical for one in effect.shapes}
        if effect.kind == "sensor":
            column = sensitivity.sensor_sensitivities(line, [(effect, shape)])[0]
        else:
            column = sensitivity.flux_sensitivities(line, [(sensitivity.unit_fluxes(line, effect, shape), small)])[0]
        ratios = [freerun.root_mean_square(part) / scale for part, scale in zip(column, noise, strict=True)]
        ratio = float(np.sqrt(np.mean(np.square(ratios))))
        unit[name] = 1.0 / max(ratio, 1e-9)
    return unit


def simulate_cases(known: Reference, cases: Sequence[Case], days: int) -> list[Telemetry]:
    """Simulate all cases of a greenhouse as one batch of greenhouses."""
    if not cases:
        return []
    start = known.greenhouse.start
    end = start + np.timedelta64(days, "D")
    seasons = simulate_many(
        [moved(known.greenhouse, case) for case in cases],
        [known.greenhouse.weather(start, end, case.seed) for case in cases],
        recipe,
        start,
        end,
        count=len(cases),
        seed=cases[0].seed,
        effects=[hidden(case, known.unit, start) for case in cases],
        disturbances=[disturbances(case) for case in cases],
    )
    return [one.measured for one in seasons]


def moved(greenhouse: VirtualGreenhouse, case: Case) -> Plant:
    """Return the greenhouse that the log of a case is of: not quite the one that the model was calibrated on."""
    return greenhouse.plant.varied(np.random.default_rng(case.seed), relative=MISMATCH)


def simulated_cases(job: tuple[Reference, Sequence[Case], int]) -> list[Telemetry]:
    """Return the same for a greenhouse, its cases and days, as one job."""
    return simulate_cases(*job)


def disturbances(case: Case) -> Disturbances:
    """Return what disturbs the greenhouse of a case."""
    usual = Disturbances(degrees_of_freedom=4.0 if case.heavy_tails else None)
    if not case.wrong_noise:
        return usual
    return replace(
        usual,
        heat=2.0 * usual.heat,
        vapour=2.0 * usual.vapour,
        co2=2.0 * usual.co2,
        correlation_hours=6.0 * usual.correlation_hours,
    )
