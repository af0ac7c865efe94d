"""A trained climate network along a measured log: free runs from any of its rows, by weather and setpoints."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from igrow.core.arrays import Floats, Integers
from igrow.core.errors import IgrowError
from igrow.core.simulator.hybrid.record import Record
from igrow.trainer.fit.evaluation import Predictor
from igrow.trainer.research.network.checkpoint import load_simulator
from igrow.trainer.training.stage import StageData, run_windows


def climate_runs(bundle: Path, record: Record, setpoints: Mapping[str, Floats]) -> Predictor:
    """Return runs of a bundle's climate stage; within an hour nothing is predicted: NaN.

    The stage steps by the hour; a log of shorter steps gives several hourly series, one for each row of the hour.

    Raises:
        IgrowError: the bundle holds no networks, or the log lacks what its climate stage reads.
    """
    stage = load_simulator(bundle).climate
    columns = {**record.inputs, **record.measured, **setpoints}
    if missing := [name for name in (*stage.drivers, *stage.states) if name not in columns]:
        raise IgrowError(f"{bundle}: its climate stage reads {', '.join(missing)}, which the log lacks")
    hour = max(1, round(3600.0 / record.step))
    count = -(-len(record) // hour)
    # Series p holds rows p, p + hour, ...; what acts over the step to a row is the mean of the hour before it.
    row = np.minimum(np.arange(count * hour).reshape(count, hour).T, len(record) - 1)
    total = np.cumsum(np.stack([columns[name] for name in stage.drivers], axis=-1), axis=0)
    total = np.concatenate([np.zeros((1, len(stage.drivers))), total])
    first = np.maximum(row - hour, 0)
    acting = (total[np.maximum(row, 1)] - total[first]) / np.maximum(row - first, 1)[..., None]
    known = np.stack([columns[name] for name in stage.states], axis=-1)
    data = StageData(acting, known[row], record.inputs["hour"][row[0]], np.ones(row.shape, dtype=bool))

    def predict(starts: Integers, steps: int) -> Mapping[str, Floats]:
        hours = steps // hour
        path = run_windows(stage, data, np.stack([starts % hour, starts // hour], axis=-1), hours)
        shown = np.full((steps, len(starts), len(stage.states)), np.nan)
        shown[hour - 1 :: hour][:hours] = np.swapaxes(path, 0, 1)
        return {name: shown[..., column] for column, name in enumerate(stage.states)}

    return predict
