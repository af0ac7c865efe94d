"""A learnt policy as `igrow-trainer policy` writes it, run day by day."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from igrow.core.arrays import Floats
from igrow.core.bundle import open_session
from igrow.core.errors import IgrowError
from igrow.core.planner.template import Setpoints
from igrow.core.site import Site
from igrow.trainer.research.policies.policy import ACTIONS, HOURS, OBSERVATIONS, observe, to_setpoints


class OnnxPolicy:
    """A policy.onnx."""

    def __init__(self, path: Path) -> None:
        """Open the graph; raises IgrowError where it is no policy of 76 observations and 96 actions."""
        self._session = open_session(path)
        shapes = {item.name: item.shape for item in (*self._session.get_inputs(), *self._session.get_outputs())}
        if [shapes.get("observation", [0])[-1], shapes.get("action", [0])[-1]] != [OBSERVATIONS, ACTIONS]:
            raise IgrowError(f"{path}: is no policy of {OBSERVATIONS} observations and {ACTIONS} actions")

    def act(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the actions (B, 96) for observations (B, 76)."""
        (actions,) = self._session.run(["action"], {"observation": observations})
        return np.asarray(actions, dtype=np.float32)

    def plan(self, site: Site, present: Mapping[str, float], forecast: Floats, start: np.datetime64) -> Setpoints:
        """Return `PAPER_SETPOINTS` (H, 4) for a forecast (H, 6): day by day, the state as it is now."""
        days = -(-len(forecast) // HOURS)
        padded = np.concatenate([forecast, forecast[-1:].repeat(days * HOURS - len(forecast), axis=0)])
        state = {name: np.array([value]) for name, value in present.items()}
        parts = []
        for day in range(days):
            begin = start + np.timedelta64(day * HOURS, "h")
            piece = padded[None, day * HOURS : (day + 1) * HOURS]
            parts.append(to_setpoints(site, self.act(observe(site, state, piece, begin)))[0])
        return np.concatenate(parts)[: len(forecast)]
