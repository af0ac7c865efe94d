"""Recalibration of one site: its log against the model in force; a better one is published; what happened is kept.

    archive --> diagnose against the bundle in force --> better? --> season --> publish --> history
                                ^                                                  |
                                +--------------- the gateway's reports <-----------+

`<state>/sites/<site>` holds `bundles/` with what was published, the newest last, `history.jsonl` with one line a run,
and the last diagnosis. A bundle that the gateway refused, or took back, is not built upon.
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime, timedelta
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from igrow.core.bundle import Bundle
from igrow.core.errors import IgrowError
from igrow.core.site import Site
from igrow.trainer.service import history, seasons
from igrow.trainer.service.archive import Archive, SiteLog
from igrow.trainer.service.history import Turn
from igrow.trainer.service.site_memory import Publish, bundle_in_force, publish_new

if TYPE_CHECKING:
    from igrow.trainer.diagnosis import Diagnosis

COMMAND = "recalibrate"
LEAST_GAIN = 0.01
"""Relative fall of the 24 h error on unseen days, mean over quantities, that is worth a new bundle."""
DAYS = 56
"""Newest days of the log that are looked at."""


def next_run(site: Site, folder: Path) -> datetime | None:
    """Return when a site is due by its own pace; None where it never ran to an end that was no error."""
    last = history.last_success(history.read(folder), COMMAND)
    return None if last is None else last + site.planning.recalibrate_every


def recalibrate(
    site: Site,
    archive: Archive,
    folder: Path,
    publish_bundle: Publish | None,
    *,
    now: datetime,
    days: int = DAYS,
    force: bool = False,
) -> Turn:
    """Diagnose one site and publish a better bundle; what happened goes into its history.

    Never raises for what the site sent: whatever fails is a line of its history and is tried again at the next run.
    Raises as `history.keep` does.

    Args:
        site: whose log it is.
        archive: where its log was collected.
        folder: of this site's memory.
        publish_bundle: is called with the folder of a bundle that passed; None diagnoses only.
        now: the time, UTC.
        days: newest days of the log to look at.
        force: run also before the site's pace says so.
    """
    due = next_run(site, folder)
    if due is not None and now < due and not force:
        return Turn(COMMAND, site.name, now, "waiting", False, f"next at {due:%Y-%m-%d %H:%M} UTC")
    run = partial(_run, site, archive, folder, publish_bundle, now, days)
    return history.keep(folder, COMMAND, site.name, now, run)


def _run(
    site: Site,
    archive: Archive,
    folder: Path,
    publish_bundle: Publish | None,
    now: datetime,
    days: int,
) -> Turn:
    from igrow.trainer.exporting import read_model  # noqa: PLC0415  (onnx is slow to import)

    log = archive.read(site.name, (now - timedelta(days=days)).date(), now.date() + timedelta(days=2))
    notes = log.notes + tuple(_missing(log))
    if len(log.telemetry) == 0:
        raise IgrowError(f"no telemetry of site {site.name} in the last {days} days: nothing was collected of it")
    bundle, unreadable = bundle_in_force(folder, log.reports)
    found = _diagnose(site, log, bundle, folder / "diagnosis")
    notes += unreadable + found.notes
    causes, fall = tuple(one.effect for one in found.findings), relative_gain(found.errors)

    def turn(note: str, *, published: bool = False) -> Turn:
        return Turn(COMMAND, site.name, now, found.verdict, published, note, causes, fall, notes)

    if found.verdict == "data_fault":
        return turn("; ".join(found.notes))
    better = fall >= LEAST_GAIN
    gain = f"{100 * fall:.1f} %"
    if publish_bundle is None and better:
        return turn(f"a model with {gain} less error a day ahead on unseen days was found")
    if publish_bundle is None or not (better or seasons.lacking(bundle, site, now)):
        return turn(f"the bundle in force stays: the new model is only {gain} better on unseen days")
    write = partial(seasons.export_planned, found.corrected, now)
    if not better:
        model, unplanned = seasons.with_season(read_model(bundle, site), now)
        if unplanned:
            notes += unplanned
            return turn("the bundle in force stays, without a season")
        write = partial(seasons.written, model)
    name, unplanned = publish_new(folder, write, publish_bundle, now, bundle.folder)
    notes += unplanned
    why = f"{gain} less error a day ahead on unseen days" if better else "the model in force, with the season planned"
    return turn(f"published {name}: {why}", published=True)


def _diagnose(site: Site, log: SiteLog, bundle: Bundle, target: Path) -> Diagnosis:
    """Diagnose a log against a bundle, and write diagnosis and report to `target`."""
    from igrow.trainer.data import prepare_log  # noqa: PLC0415  (scipy is slow to import)
    from igrow.trainer.diagnosis import diagnose  # noqa: PLC0415
    from igrow.trainer.exporting import read_model  # noqa: PLC0415
    from igrow.trainer.report import write_diagnosis  # noqa: PLC0415

    prepared = prepare_log(log.telemetry, site, name=site.name)
    diagnosis = diagnose(prepared, read_model(bundle, site))
    write_diagnosis(target, diagnosis)
    return diagnosis


def relative_gain(errors: Mapping[str, Mapping[str, Mapping[str, float]]]) -> float:
    """Return the relative fall of the 24 h error on unseen days, mean over quantities (0 where none is known)."""
    falls = [
        1.0 - day["corrected"] / day["deployed"]
        for horizons in errors.values()
        if (day := horizons.get("24_h")) and day.get("deployed", 0.0) > 0.0 and "corrected" in day
    ]
    return sum(falls) / len(falls) if falls else 0.0


def _missing(log: SiteLog) -> list[str]:
    if not log.missing_days:
        return []
    days = ", ".join(f"{day}" for day in log.missing_days[:10])
    more = f" and {len(log.missing_days) - 10} more" if len(log.missing_days) > 10 else ""
    return [f"{len(log.missing_days)} days have no row: {days}{more}"]
