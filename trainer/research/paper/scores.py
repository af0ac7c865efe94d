"""How well free runs follow seasons: R2 per quantity, mean over the seasons, beside the published figures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from igrow.core.arrays import Floats, Mask
from igrow.core.simulator.network_run import day_ends
from igrow.trainer.research.network.leaf_picking import smooth

HOURLY = (
    "air_temperature", "air_humidity", "air_co2", "par", "leaf_area_index", "plant_load", "net_growth",
)  # fmt: skip
SCORED = (*HOURLY, "fruit_fresh_weight")
"""All hourly but the harvest, which is scored at the end of each day, as the paper does."""

PUBLISHED_BASELINE: Mapping[str, float] = {
    "air_temperature": 0.915, "air_humidity": 0.707, "air_co2": 0.930, "par": 1.0, "leaf_area_index": 0.927,
    "plant_load": 0.935, "net_growth": 0.959, "fruit_fresh_weight": 0.917,
}  # fmt: skip
PUBLISHED_INCREMENTAL: Mapping[str, float] = {
    "air_temperature": 0.986, "air_humidity": 0.941, "air_co2": 0.988, "par": 1.0, "leaf_area_index": 0.669,
    "plant_load": 0.849, "net_growth": 0.939, "fruit_fresh_weight": 0.880,
}  # fmt: skip
"""Table 1 of Cao et al. (2022), as their published weights give it: free runs over whole seasons."""


@dataclass(frozen=True)
class Score:
    """R2 of one quantity over several seasons."""

    mean: float
    low: float
    """The worst season's."""
    seasons: tuple[float, ...]


def r2(truth: Floats, predicted: Floats) -> Floats:
    """Return the coefficient of determination of each row, (runs,): 1 - sum of squares / sum about the mean."""
    residual = ((truth - predicted) ** 2).sum(axis=1)
    about_mean = ((truth - truth.mean(axis=1, keepdims=True)) ** 2).sum(axis=1)
    return np.asarray(1.0 - residual / about_mean)


def score(truth: Mapping[str, Floats], predicted: Mapping[str, Floats], valid: Mask) -> dict[str, Score]:
    """Return the scores of all quantities; columns are (runs, hours), hours that are not `valid` do not count.

    The leaf area is smoothed on both sides, over all hours, as the paper scores it: the trend, not each picking.
    """
    scores = {}
    truth, predicted = (
        {**columns, "leaf_area_index": smooth(columns["leaf_area_index"])} for columns in (truth, predicted)
    )
    for name in SCORED:
        rows = np.flatnonzero(valid)
        if name == "fruit_fresh_weight":
            ends = day_ends(valid.size)
            rows = ends[valid[ends]]
        values = r2(truth[name][:, rows], predicted[name][:, rows])
        scores[name] = Score(float(values.mean()), float(values.min()), tuple(float(value) for value in values))
    return scores
