"""How far a strategy leaves the range of the training data."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.trainer.exporting.blocks import Block, trace

RANGED = ("air_temperature", "air_humidity", "air_co2", "outdoor_temperature", "global_radiation")
"""Quantities whose distance from the range of the training data is reported."""


def range_block(known: Mapping[str, tuple[float, float]]) -> Block:
    """Trace the largest distance of `RANGED` from their known ranges, in widths of the range.

    Args:
        known: smallest and largest value of quantities in the training data.
    """

    def formula(xp: Any, arrays: Mapping[str, Any]) -> Mapping[str, Any]:
        outside = 0.0 * arrays["air_temperature"]
        for name in RANGED:
            low, high = known.get(name, (-1e9, 1e9))
            width = max(high - low, 1e-6)
            outside = xp.maximum(outside, (arrays[name] - high) / width)
            outside = xp.maximum(outside, (low - arrays[name]) / width)
        return {"outside": outside}

    return trace("training_range", formula, RANGED)
