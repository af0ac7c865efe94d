"""The crop of a log, beside the one that its model was calibrated on.

A calibration in a young crop puts what its model says wrongly of leaves into the parameters, and these are off as the
crop grows on; more so where nobody measures the leaf area, and the usual course since the planting stands in
(`nominal.leaf_area_curve`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from igrow.core.arrays import Times
from igrow.core.effects import EFFECTS
from igrow.core.simulator.hybrid.nominal import leaf_area_curve
from igrow.core.site import Site
from igrow.trainer.data.log import Log
from igrow.trainer.diagnosis.knowledge import CROP
from igrow.trainer.diagnosis.rules import DecisionRules
from igrow.trainer.diagnosis.visible_parameters import VISIBLE
from igrow.trainer.fit.discrepancy import Discrepancy
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


def new_leaves(known: Discrepancy | None, site: Site, leaf_area: float) -> float:
    """Return the share of a log's leaves that a calibration has not seen, or of its leaves that are gone.

    Args:
        known: what the calibration learned of the greenhouse.
        site: as it is described now.
        leaf_area: mean leaf area index of the log, measured or by the usual course.
    """
    if known is None:
        return 0.0
    then = known.leaf_area
    if np.isnan(then):
        then = float(leaf_area_curve(site, np.array([known.middle])).mean())
    return abs(leaf_area - then) / max(leaf_area, then, 1e-9)


def with_its_drift(rules: DecisionRules, new: float, *, measured: bool = True) -> DecisionRules:
    """Return rules by which crop, light and discrepancy may differ by the share of the leaves that is new to the model.

    What a model says of few leaves does not hold of many: which share of the light they take, what they make of it, and
    what the model misses of both. For that share all is as uncertain again as before the calibration. Of a share that
    the null bounds were learned of these know that already; but where nobody measures the leaf area the parameters of
    the crop hold its error too.

    Args:
        rules: every threshold.
        new: that share; 1 for a crop that the calibration has not seen.
        measured: the log has the leaf area.
    """
    share = new * rules.new_crop_drift
    wider = replace(rules, crop_drift=max(rules.crop_drift, share))
    if new <= rules.most_new_leaves:
        return rules if measured else wider
    return replace(
        wider,
        light_drift=max(rules.light_drift, share),
        effect_drift=max(rules.effect_drift, new * rules.omission_effect),
        co2_source_drift=max(rules.co2_source_drift, new * rules.omission_effect),
        pattern_drift=max(rules.pattern_drift, new * rules.omission_pattern),
    )
