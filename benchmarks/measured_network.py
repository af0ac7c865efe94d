"""The climate stage of the network variant, trained on a measured log and driven by its actuators: a rival.

The stage steps by the hour; a log of 5 min gives twelve hourly series, one for each row of the hour, and all are
learned from. Between the hours of a run its values lie on a straight line.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from igrow.core.arrays import Floats, Integers, Mask
from igrow.core.simulator.hybrid.record import Record
from igrow.trainer.fit.evaluation import Predictor
from igrow.trainer.training.stage import StageData, StageLayout, TrainingPlan, run_windows, train_stage, untrained

PLAN = TrainingPlan(updates=((4, 1500), (24, 500)), decay=10.0)
"""Chosen on weeks 7 and 8 of the AGC 2019 Reference compartment after training on weeks 1 to 6."""
_NO_DRIVERS = ("elapsed_days", "hour")
"""A day's number lies beyond all that was learned from; the hour jumps at midnight, and the sun's place tells it."""


def network_predictor(record: Record, setpoints: Mapping[str, Floats], fit: Mask) -> Predictor:
    """Return runs of a climate stage that learned from the rows `fit` (n,); `setpoints` by name, (n,)."""
    columns = {name: values for name, values in {**record.inputs, **setpoints}.items() if name not in _NO_DRIVERS}
    drivers = tuple(name for name, values in columns.items() if np.ptp(values[fit]) > 0.0)
    states = tuple(name for name, values in record.measured.items() if np.isfinite(values[fit]).any())
    hour = round(3600.0 / record.step)
    count = -(-len(record) // hour)
    # Series p holds rows p, p + hour, ...; what acts over the step to a row is the mean of the hour before it.
    place = np.arange(count * hour).reshape(count, hour).T
    row = np.minimum(place, len(record) - 1)
    total = np.cumsum(np.stack([columns[name] for name in drivers], axis=-1), axis=0)
    total = np.concatenate([np.zeros((1, len(drivers))), total])
    first = np.maximum(row - hour, 0)
    acting = (total[np.maximum(row, 1)] - total[first]) / np.maximum(row - first, 1)[..., None]
    known = np.stack([record.measured[name] for name in states], axis=-1)
    valid = (fit & record.usable)[row] & (place < len(record))
    data = StageData(acting, known[row], np.zeros(count), valid)
    stage = untrained(StageLayout("climate", states, drivers, (1.0, 3.0, 24.0), (64, 64)), data, seed=0)
    stage = train_stage(stage, data, PLAN)

    def predict(starts: Integers, steps: int) -> Mapping[str, Floats]:
        hours = -(-steps // hour)
        path = run_windows(stage, data, np.stack([starts % hour, starts // hour], axis=-1), hours)
        path = np.concatenate([known[starts][:, None], path], axis=1)
        lead = np.arange(1, steps + 1) / hour
        before = np.minimum(lead.astype(np.int64), hours - 1)
        part = (lead - before)[:, None]
        values = (1.0 - part) * path[:, before] + part * path[:, before + 1]
        return {name: values[..., column].T for column, name in enumerate(states)}

    return predict
