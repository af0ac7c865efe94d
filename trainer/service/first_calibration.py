"""The first bundle of a site's own, or of its new crop: calibrated on its log once four weeks of it are there.

A new gateway plans with the built-in bundle, which knows its greenhouse by description alone. From the first bundle on
that was calibrated on the site itself, `recalibration.py` goes on, until a new crop is planted.
"""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime, timedelta
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from igrow.core.bundle import Bundle
from igrow.core.simulator.hybrid.parameters import fitted_to_these_balances
from igrow.core.site import Site
from igrow.trainer.service import history, seasons
from igrow.trainer.service.archive import Archive, SiteLog
from igrow.trainer.service.history import Turn
from igrow.trainer.service.recalibration import LEAST_GAIN, relative_gain
from igrow.trainer.service.site_memory import Publish, bundle_in_force, publish_new

if TYPE_CHECKING:
    from igrow.trainer.data import Log
    from igrow.trainer.fit import FittedModel

COMMAND = "calibrate"
LEAST_DAYS = 28
"""Of log, so that every fourth week can be held back and the errors on it be told."""


def calibrate_first(
    site: Site,
    archive: Archive,
    folder: Path,
    publish_bundle: Publish,
    *,
    now: datetime,
    days: int,
    population: Path | None = None,
) -> Turn:
    """Calibrate a site that has no bundle of its own, or of its crop, and publish it where it is better.

    Never raises for what the site sent: an error is a line of its history. Raises as `history.keep` does.

    Args:
        site: whose log it is.
        archive: where its log was collected.
        folder: of this site's memory.
        publish_bundle: is called with the folder of a bundle that passed.
        now: the time, UTC.
        days: newest days of the log to look at.
        population: file of what the fleet has learned of its greenhouses; None: the site's description is the prior.
    """
    log = archive.read(site.name, (now - timedelta(days=days)).date(), now.date() + timedelta(days=2))
    bundle, notes = bundle_in_force(folder, log.reports)
    if bundle.manifest.calibrated_on == site.name and fitted_to_these_balances(bundle.manifest.parameters):
        if not _has_new_crop(site, log, bundle):
            note = f"{bundle.label} was calibrated on it already; recalibrate corrects it"
            return Turn(COMMAND, site.name, now, "waiting", False, note, notes=notes)
        log = replace(log, telemetry=log.telemetry.select(np.datetime64(site.crop.planting_date, "s")))
    time = log.telemetry.time
    length = 0.0 if len(time) == 0 else float((time[-1] - time[0]) / np.timedelta64(1, "D"))
    if length < LEAST_DAYS:
        note = f"{length:.0f} days of log are there, {LEAST_DAYS} are needed"
        return Turn(COMMAND, site.name, now, "waiting", False, note, notes=notes)
    work = partial(_calibrate, site, log, bundle, folder, publish_bundle, now, population)
    return history.keep(folder, COMMAND, site.name, now, work)


def _has_new_crop(site: Site, log: SiteLog, bundle: Bundle) -> bool:
    from igrow.trainer.diagnosis.crop import has_new_crop  # noqa: PLC0415  (scipy is slow to import)
    from igrow.trainer.exporting import read_model  # noqa: PLC0415

    return has_new_crop(log.telemetry.time, site, read_model(bundle, site))


def _calibrate(
    site: Site,
    log: SiteLog,
    bundle: Bundle,
    folder: Path,
    publish_bundle: Publish,
    now: datetime,
    population: Path | None,
) -> Turn:
    from igrow.trainer.calibration import calibrate  # noqa: PLC0415
    from igrow.trainer.data import prepare_log  # noqa: PLC0415  (scipy is slow to import)
    from igrow.trainer.exporting import read_model  # noqa: PLC0415
    from igrow.trainer.fit.population import read_population  # noqa: PLC0415

    prepared = prepare_log(log.telemetry, site, name=site.name)
    model = calibrate(prepared, population=None if population is None else read_population(population))
    gain, notes = _gain(prepared, model, read_model(bundle, site)), (*log.notes, *model.notes)

    def turn(note: str, *, published: bool = False) -> Turn:
        return Turn(COMMAND, site.name, now, "calibrated", published, note, gain=gain, notes=notes)

    if gain < LEAST_GAIN:
        return turn(f"the bundle in force stays: on unseen weeks the calibration is only {100 * gain:.1f} % better")
    write = partial(seasons.export_planned, model, now)
    name, unplanned = publish_new(folder, write, publish_bundle, now, bundle.folder)
    notes += unplanned
    return turn(f"published {name}: {100 * gain:.1f} % less error a day ahead on unseen weeks", published=True)


def _gain(log: Log, model: FittedModel, deployed: FittedModel) -> float:
    """Return the relative fall of the 24 h error on weeks that the fit did not see, mean over quantities."""
    from igrow.trainer.data.splits import held_out_weeks  # noqa: PLC0415
    from igrow.trainer.fit import evaluate  # noqa: PLC0415

    record = log.record(model.alignment or 0.0)
    held_out = held_out_weeks(record.time)
    errors = evaluate(record, deployed.posterior.values, deployed.active_effects, ("24_h",), held_out)
    beside = {
        one.quantity: {"24_h": {"deployed": errors[one.quantity]["24_h"].mae, "corrected": one.after}}
        for one in model.errors
        if one.horizon == "24_h"
    }
    return relative_gain(beside)
