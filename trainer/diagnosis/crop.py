"""The crop of a log, beside the one that its model was calibrated on.

Where nobody measures the leaf area, the usual course since the planting stands in (`nominal.leaf_area_curve`). A
calibration in a young crop puts that course's error into the crop's parameters, and they are off as it grows on.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from igrow.core.arrays import Times
from igrow.core.effects import EFFECTS
from igrow.core.simulator.hybrid.nominal import leaf_area_curve, measures_leaf_area
from igrow.core.site import Site
from igrow.trainer.data.log import Log
from igrow.trainer.diagnosis.knowledge import CROP
from igrow.trainer.diagnosis.rules import DecisionRules
from igrow.trainer.diagnosis.visible_parameters import VISIBLE
from igrow.trainer.fit.model import FittedModel

_OF_LEAVES = frozenset({"leaf_area_index", "transpiration", "assimilation"})
LEAVES_AND_LIGHT = CROP.union(
    (name for name, one in EFFECTS.items() if "light" in one.balances or _OF_LEAVES.intersection(one.drivers)),
    (name for name, one in VISIBLE.items() if "light" in one.balances),
)
"""Parameters and effects of the crop and of the light, which the leaves share out between air, floor and growth."""


def of_one_crop(log: Log, rules: DecisionRules) -> tuple[Log, tuple[str, ...]]:
    """Return the days of a log since its crop was planted, with a note; those before where that is less than a week."""
    planted, time = log.known_site.crop.planting_date, log.telemetry.time
    first = np.datetime64(planted, "s")
    if not time[0] < first <= time[-1]:
        return log, ()
    since, before = log.select(first), log.select(end=first)
    if since.days >= rules.least_days:
        return since, (f"The crop was planted on {planted}: the days before are left out.",)
    if before.days >= rules.least_days:
        return before, (f"The crop was planted on {planted}, less than a week ago: the days since are left out.",)
    return log, ()


def has_new_crop(time: Times, site: Site, model: FittedModel) -> bool:
    """Tell whether the crop in which a log ends is none that its model was calibrated on, or only in the later half.

    Args:
        time: of the log, UTC, (n,).
        site: as it is described now.
        model: in force.
    """
    known, planted = model.history, np.datetime64(site.crop.planting_date, "s")
    return known is not None and bool(np.any(time[-1:] >= planted)) and bool(known.middle < planted)


def with_its_drift(rules: DecisionRules, log: Log, model: FittedModel) -> DecisionRules:
    """Return rules by which a crop may differ as far as its leaf area does, where only the usual course tells that."""
    site, known, telemetry = log.known_site, model.history, log.telemetry
    if has_new_crop(telemetry.time, site, model):
        return replace(rules, crop_drift=rules.new_crop_drift)
    if known is None or measures_leaf_area(telemetry):
        return rules
    then, now = (float(leaf_area_curve(site, time).mean()) for time in (np.array([known.middle]), telemetry.time))
    grown = abs(now - then) / max(now, then)
    return replace(rules, crop_drift=max(rules.crop_drift, grown * rules.new_crop_drift))
