"""The benchmark's logs: the reference logs that models are calibrated on, and the logs of all cases of a house."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.diagnosis.cases import Case, hidden
from benchmarks.diagnosis.houses import House
from igrow.core import sun
from igrow.core.bundle import default_bundle_folder, read_bundle
from igrow.core.effects import EFFECTS
from igrow.core.greenhouse import Disturbances, recipe, simulate_many
from igrow.core.greenhouse.uncatalogued import UNCATALOGUED
from igrow.core.simulator.hybrid.nominal import nominal
from igrow.core.simulator.hybrid.record import Record
from igrow.core.site import Site
from igrow.core.telemetry import Telemetry
from igrow.trainer.calibration import calibrate, prior
from igrow.trainer.data import prepare_log
from igrow.trainer.data.splits import split_days
from igrow.trainer.diagnosis import freerun, linearisation
from igrow.trainer.diagnosis.deployed import Deployed, from_manifest, from_posterior, learn_misfit
from igrow.trainer.diagnosis.linearisation import unit_fluxes

REFERENCE_DAYS = 56
MISMATCH = 0.08
"""Relative deviation of every plant parameter from the calibrated greenhouse's."""


@dataclass(frozen=True)
class Reference:
    """A house, its deployed model, and the amplitude of ENR 1 of every cause."""

    house: House
    deployed: Deployed
    unit: dict[str, float]


def reference(house: House) -> Reference:
    """Simulate the unchanged greenhouse for eight weeks, calibrate on them, and measure sizes."""
    start = house.start - np.timedelta64(REFERENCE_DAYS, "D")
    weather = house.weather(start, house.start, house.seed)
    (log,) = simulate_many(house.plant, weather, recipe, start, house.start, count=1, seed=house.seed)
    site = house.site
    seen = prepare_log(log.measured, site)
    shift = seen.best_shift(nominal(site))
    record = seen.record(shift)
    posterior = calibrate([(record, None)], prior(nominal(site)), {}, every_hours=8.0)
    misfit = learn_misfit(
        record, posterior.values, dict(zip(posterior.names, posterior.standard_deviation, strict=True)), site.longitude
    )
    deployed = replace(from_posterior(posterior, misfit), shift=shift)
    return Reference(house, deployed, enr_units(record, site, deployed))


def built_in(site: Site) -> Deployed:
    """Return the model of the built-in bundle, which knows a site's description alone."""
    return from_manifest(read_bundle(default_bundle_folder()).manifest, site)


def enr_units(record: Record, site: Site, deployed: Deployed) -> dict[str, float]:
    """Return, for every cause, the amplitude at which ENR is one on a log without it."""
    days = split_days(record, site.longitude)
    runs = linearisation.day_runs(record, days.day)
    line = linearisation.linearise(record, runs, deployed.parameters, {})
    noise = [freerun.root_mean_square(np.where(w, e, np.nan)) for w, e in zip(runs.weight, line.errors, strict=True)]
    unit = {}
    line = replace(
        line, drivers={**line.drivers, "weekday": 1.0 * sun.weekday(sun.solar_day(record.time, site.longitude))}
    )
    for name, effect in {**EFFECTS, **UNCATALOGUED}.items():
        small = 0.2 * effect.amplitude.typical
        shape = {one.name: one.typical for one in effect.shapes}
        if effect.kind == "sensor":
            column = linearisation.sensor_column(line, effect, shape)
        else:
            column = linearisation.flux_columns(line, [(unit_fluxes(line, effect, shape), small)])[0]
        ratios = [freerun.root_mean_square(part) / scale for part, scale in zip(column, noise, strict=True)]
        ratio = float(np.sqrt(np.mean(np.square(ratios))))
        unit[name] = 1.0 / max(ratio, 1e-9)
    return unit


def simulate_cases(known: Reference, cases: Sequence[Case], days: int) -> list[Telemetry]:
    """Simulate all cases of a house as one batch of greenhouses."""
    if not cases:
        return []
    start = known.house.start
    end = start + np.timedelta64(days, "D")
    seasons = simulate_many(
        [known.house.plant.varied(np.random.default_rng(case.seed), relative=MISMATCH) for case in cases],
        [known.house.weather(start, end, case.seed) for case in cases],
        recipe,
        start,
        end,
        count=len(cases),
        seed=cases[0].seed,
        effects=[hidden(case, known.unit, start) for case in cases],
        disturbances=[_disturbances(case) for case in cases],
    )
    return [one.measured for one in seasons]


def _disturbances(case: Case) -> Disturbances:
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
