"""The season in every bundle that the loop publishes: a day that is planned without it knows an average price alone."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING
from zoneinfo import ZoneInfo

import numpy as np

from igrow.core.bundle import Bundle
from igrow.core.errors import IgrowError
from igrow.core.planner.season import SeasonPlan
from igrow.core.site import Site
from igrow.trainer.season import SHORTEST, first_day, plan_season

if TYPE_CHECKING:
    from igrow.trainer.fit import FittedModel

LONGEST = timedelta(days=364)
"""From the first day to the last that is planned of a crop that stands for years: the work grows with the square."""


def lacking(bundle: Bundle, site: Site, now: datetime) -> bool:
    """Tell whether a site's crop stands in a season of which the bundle in force knows nothing."""
    crop, today = site.crop, now.astimezone(ZoneInfo(site.time_zone)).date()
    if crop.end_date is None or today < crop.planting_date or (crop.end_date - today).days < SHORTEST:
        return False
    season = SeasonPlan.of(bundle) if bundle.manifest.site == site.name else None
    return season is None or not season.covers(np.datetime64(now.replace(tzinfo=None), "s"))


def with_season(model: FittedModel, now: datetime) -> tuple[FittedModel, tuple[str, ...]]:
    """Return a model with what is left of the season planned on its own simulator, and a sentence where it cannot be.

    It then keeps the season that it had. Takes some minutes.
    """
    from igrow.trainer.exporting import export  # noqa: PLC0415  (onnx is slow to import)

    site = model.site
    begins = first_day(site, now.astimezone(ZoneInfo(site.time_zone)).date())
    if site.crop.end_date is not None:
        site = replace(site, crop=replace(site.crop, end_date=min(site.crop.end_date, begins + LONGEST)))
    try:
        with TemporaryDirectory() as scratch:
            bundle = export(model, Path(scratch) / "simulator")
            return replace(model, season=plan_season(site, bundle, begins=begins)), ()
    except IgrowError as error:
        return model, (f"no season is planned: {error}",)


def export_planned(model: FittedModel, now: datetime, folder: Path) -> tuple[str, ...]:
    """Write a model with what is left of the season as a bundle; returns a sentence where that cannot be planned."""
    model, notes = with_season(model, now)
    return notes + written(model, folder)


def written(model: FittedModel, folder: Path) -> tuple[str, ...]:
    """Write a model as a bundle; there is nothing to be said of it."""
    from igrow.trainer.exporting import export  # noqa: PLC0415

    export(model, folder)
    return ()
