"""Growth and yield as blocks: one step of a crop stage, and the balance of net growth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from igrow.core.simulator import network
from igrow.core.simulator.crop import CropStages, net_growth_rate
from igrow.trainer.exporting.blocks import Block, grouped, tags, trace, traceable

_EDGE = 3.0
"""Standard deviations of the training data within which a crop stage is believed."""


def crop_block(name: str, stage: network.Stage, drivers: Sequence[str]) -> Block:
    """Trace one step of a crop stage over tensors of (batch,)."""
    if stage.drivers != tuple(drivers) or stage.time_constants or stage.clock:
        raise ValueError(f"the {name} stage must read {', '.join(drivers)} and nothing else")

    def formula(xp: Any, arrays: Mapping[str, Any]) -> Mapping[str, Any]:
        named = grouped(arrays)
        like = 0.0 * named["state"][stage.states[0]]
        read = xp.stack([named["driver"][driver] + like for driver in stage.drivers], axis=-1)
        state = xp.stack([named["state"][one] + like for one in stage.states], axis=-1)
        # Beyond what it was trained on a network knows nothing: there it goes on as at the edge. How much was grown
        # or picked before is no reason to grow: of a cumulative state it sees the mean.
        edge = np.where(np.array(stage.cumulative), 0.0, _EDGE).astype(np.float32)
        inside = _clipped(xp, state, stage.state_offset, edge * stage.state_scale)
        read = _clipped(xp, read, stage.feature_offset, _EDGE * stage.feature_scale)
        following, _ = network.advance(xp, traceable(stage), inside, read, read[..., :0])
        following = following + (state - inside)
        return {one: following[..., column] for column, one in enumerate(stage.states)}

    return trace(name, formula, tags("driver", stage.drivers) + tags("state", stage.states))


def net_growth_block(crop: CropStages) -> Block:
    """Trace what assimilation adds to net growth in an hour."""

    def formula(xp: Any, arrays: Mapping[str, Any]) -> Mapping[str, Any]:
        rate = net_growth_rate(xp, arrays["assimilation"], arrays["air_temperature"], crop.conversion, crop.maintenance)
        return {"net_growth": arrays["net_growth"] + rate}

    return trace("net_growth", formula, ["net_growth", "assimilation", "air_temperature"])


def _clipped(xp: Any, values: Any, middle: Any, width: Any) -> Any:
    low, high = xp.asarray(middle - width), xp.asarray(middle + width)
    return xp.minimum(xp.maximum(values, low), high)
