"""How fast a log's crop grows: what drove its growth, what was counted of it, and the fit of both.

Counted is, in this order: net growth of the plant; fruit picked, as a running total of the log or as a table of
harvests. Weekly counts do, and so does one a month.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from igrow.core.arrays import Floats, Integers
from igrow.core.bundle import Bundle, default_bundle_folder, read_bundle
from igrow.core.local_time import to_local
from igrow.core.simulator.crop import CropStages
from igrow.core.simulator.growth import Count, GrowthDays, GrowthFit, fit_growth, prior_of, warmth
from igrow.core.simulator.hybrid.climate import ActiveEffects
from igrow.core.simulator.hybrid.record import Record, uptake
from igrow.core.site import Site
from igrow.core.telemetry import Telemetry
from igrow.trainer.data import Log
from igrow.trainer.data.source import DailyTable
from igrow.trainer.training.stage_file import stages_from_bytes

CROP_FILE = "crop.npz"
COUNTING = 0.15
"""Standard deviation of a count over what is usual in as many days: plants are a sample, no picking is on time."""
CHANGE = 0.1
"""Standard deviation by which a crop's conversion may change from one log to the next, over its value."""
WEEK = 7
"""Days over which what is picked is added up at least: what was not picked today is picked tomorrow."""
FAR = 2.0
"""Standard deviations of what was known before, beyond which counts and site file are asked about."""
COVERED = 0.8
"""Share of a day that must have been measured for its growth to be told."""


class Canopy(NamedTuple):
    """What takes up CO2, as a model has it."""

    parameters: Mapping[str, float]
    """Of the climate stage."""
    effects: ActiveEffects = MappingProxyType({})
    """Of the model, as `igrow.core.simulator.hybrid.climate` takes them."""


def crop_of(bundle: Bundle) -> CropStages:
    """Return the growth and yield stages that a bundle carries; raises BundleError where they cannot be read."""
    stages, _ = stages_from_bytes(bundle.content(CROP_FILE), where=str(bundle.folder / CROP_FILE))
    settings = bundle.manifest.simulator
    growth = float(settings.get("conversion", 0.0)), float(settings.get("maintenance", 0.0))
    covariance = settings.get("growth_covariance")
    known = None if covariance is None else np.array(covariance, dtype=np.float64)
    return CropStages(stages["growth"], stages["harvest"], *growth, known)


def built_in_crop() -> CropStages:
    """Return the stages of the bundle that came with the trainer."""
    return crop_of(read_bundle(default_bundle_folder()))


def growth_of_log(log: Log, record: Record, canopy: Canopy, before: CropStages) -> tuple[CropStages, GrowthFit]:
    """Return the stages with conversion and maintenance as the log's counts tell them, and how well they are known.

    Args:
        log: with the counts, and the site's crop.
        record: of the log.
        canopy: that assimilates.
        before: what is known before the log.
    """
    site = log.known_site
    first, days = growth_days(record, canopy, site.time_zone)
    counts = counts_of(log.telemetry, log.harvests, first, len(days.warmth), site.time_zone)
    return fit_growth(days, counts, before, site.crop)


def growth_since(log: Log, record: Record, was: Canopy, now: Canopy, without: Canopy, before: CropStages) -> CropStages:
    """Return the stages for a canopy that a later log has moved, with what it counts of growth.

    Conversion belongs to the assimilation that it was fitted beside. Where the balance of CO2 has moved that, growth of
    the log's days stays what it was, but for what was found to be missing: light that a cover loses, or assimilation
    that a crop cannot do any more, is growth that is lost. Counts change it either way.

    Args:
        log: the later one.
        record: of it.
        was: the canopy before the log.
        now: after it, with all that was found.
        without: the canopy after it, without what was found.
        before: what was known of growth.
    """
    site = log.known_site
    (first, old), (_, moved), (_, new) = (growth_days(record, canopy, site.time_zone) for canopy in (was, without, now))
    taken_up = float(np.nansum(moved.assimilated))
    share = float(np.nansum(old.assimilated)) / taken_up if taken_up > 0.0 else 1.0
    scale = np.diag([share, 1.0])
    grown = np.diag([(CHANGE * share * before.conversion) ** 2, 0.0])
    known = replace(before, conversion=share * before.conversion, covariance=scale @ prior_of(before) @ scale + grown)
    counts = counts_of(log.telemetry, log.harvests, first, len(new.warmth), site.time_zone)
    return fit_growth(new, counts, known, site.crop)[0]


def growth_notes(site: Site, before: CropStages, fit: GrowthFit) -> tuple[str, ...]:
    """Return what a grower must know of a fit of growth, in sentences."""
    notes = [fit.sentence, *filter(None, [site.crop.unlike_its_species])]
    spread = float(np.sqrt(prior_of(before)[0, 0]))
    if fit.counts and abs(fit.conversion - before.conversion) > FAR * spread:
        notes.append(
            f"the counts say that this crop makes {fit.conversion / before.conversion:.1f} times the dry matter that "
            f"others make of the same light: are dry_matter_fraction ({site.crop.dry_matter_fraction:g}), fruit_share "
            f"({site.crop.fruit_share:g}) and days_to_harvest ({site.crop.days_to_harvest:g}) those of this crop?"
        )
    return tuple(notes)


def growth_days(record: Record, canopy: Canopy, time_zone: str) -> tuple[np.datetime64, GrowthDays]:
    """Return the first local day of a record, and what drove growth on each day from then on; NaN where none tells."""
    assimilated, air_temperature = uptake(record, *canopy)
    day = to_local(record.time, time_zone).astype("datetime64[D]")
    number = (day - day[0]).astype(np.int64)
    hours = record.step / 3600.0
    known = record.usable & np.isfinite(assimilated) & np.isfinite(air_temperature)
    measured = np.bincount(number, known)

    def total(values: Floats) -> Floats:
        summed = np.bincount(number, np.where(known, values, 0.0))
        # What was not measured of a day is taken as the rest of it.
        whole = 24.0 / np.maximum(measured, 1.0)
        return np.where(measured * hours >= COVERED * 24.0, summed * whole, np.nan)

    return day[0], GrowthDays(total(3600.0 * assimilated), total(warmth(air_temperature)))


def counts_of(
    table: Telemetry, harvests: DailyTable | None, first: np.datetime64, days: int, time_zone: str
) -> list[Count]:
    """Return what a log counts of growth, by days from the local day `first` on; empty where it counts nothing."""
    for name, kind in (("net_growth", "grown"), ("fruit_fresh_weight", "picked")):
        known = np.isfinite(table.columns.get(name, np.empty(0)))
        if known.sum() > 1:
            # A value belongs to the end of the day before it, or to the beginning of its own, whichever is nearer; of
            # those that belong to one midnight, to which a total of every minute has a thousand, the nearest counts.
            local = (to_local(table.time[known], time_zone) - first) / np.timedelta64(1, "D")
            at = np.floor(local + 0.5).astype(np.int64)  # noon, too, always to the midnight after
            nearest = np.lexsort((np.abs(local - at), at))
            midnights, place = np.unique(at[nearest], return_index=True)
            return _between(midnights, table[name][known][nearest[place]], kind, days)
    if harvests is None or "class_a" not in harvests:
        return []
    picked = np.nan_to_num(harvests["class_a"])
    if "class_b" in harvests:
        picked = picked + np.nan_to_num(harvests["class_b"])
    # What was picked on a day ripened since the one before; of the first nobody knows.
    return _between((harvests.day - first).astype(np.int64) + 1, np.cumsum(picked), "picked", days)


def _between(at: Integers, running: Floats, kind: str, days: int) -> list[Count]:
    """Return the counts between days at which a running total is known, as far as they lie within `days`."""
    chosen = [0]
    for row in range(1, len(at)):
        if kind == "grown" or at[row] - at[chosen[-1]] >= WEEK:
            chosen.append(row)
    at, amounts = at[chosen], np.diff(running[chosen])
    # Of the mean rate, not of each amount: where small counts are believed more than large ones, a sum is underrated.
    rate = float(np.abs(amounts).sum()) / max(int(at[-1] - at[0]), 1)
    deviation = COUNTING * rate * np.diff(at)
    rows = zip(at[:-1].tolist(), at[1:].tolist(), amounts.tolist(), deviation.tolist(), strict=True)
    return [
        Count(begin, end, amount, max(spread, 1e-5), kind)
        for begin, end, amount, spread in rows
        if 0 <= begin < end <= days
    ]
