"""Which interval an actuator's cell stands for: the step after its row, the step before, or the middle.

Climate computers log actuators as they are at the row's time, or as means over the interval that ends there. A
step of five minutes too late looks like a lag of pipes or vents, so the log itself is asked: the reading under
which the errors of one step scatter least is taken.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from igrow.core.quantities import ACTUATORS
from igrow.core.simulator.hybrid import measurement
from igrow.core.simulator.hybrid.nominal import site_record
from igrow.core.simulator.hybrid.record import free_run, observe
from igrow.core.site import Site
from igrow.core.telemetry import Telemetry

SHIFTS = (0.0, 0.5, 1.0)
"""Rows by which actuators are read ahead."""
_DAYS = 14
"""Days that suffice to tell."""
_LEAST_SCATTER = 1e-9
"""Of a log without any noise."""
_MARGIN = 0.01
"""Fall of the log of the scatter that a reading ahead must bring."""


def best_shift(telemetry: Telemetry, site: Site, parameters: Mapping[str, float]) -> float:
    """Return the shift of `SHIFTS` under which the one-step errors of the first days scatter least."""
    step = telemetry.step
    part = telemetry.select(None, telemetry.time[0] + np.timedelta64(_DAYS, "D"))
    record = site_record(part, site, step)
    if len(record) < 100:
        return 0.0
    base = dict(record.inputs)
    moving = [name for name in ACTUATORS if name not in record.missing]
    starts = np.flatnonzero(record.usable[:-1])
    scatter = []
    for shift in SHIFTS:
        inputs = {
            name: (1.0 - shift) * values + shift * np.append(values[1:], values[-1:]) if name in moving else values
            for name, values in base.items()
        }
        moved = replace(record, inputs=inputs)
        states = observe(moved, parameters, {})
        shown = free_run(moved, states, starts, 1, parameters, {})
        total = 0.0
        for name in measurement.PREDICTED:
            error = shown[name][0] - record.measured[name][starts + 1]
            change = np.abs(np.diff(error))
            if np.isfinite(change).any():
                total += float(np.log(max(np.nanmean(change), _LEAST_SCATTER)))
        scatter.append(total)
    best = int(np.argmin(scatter))
    return SHIFTS[best] if scatter[best] < scatter[0] - _MARGIN else 0.0


def read_ahead(telemetry: Telemetry, shift: float) -> Telemetry:
    """Return the log with its actuators read `shift` rows (0, 0.5 or 1) ahead; before a gap they stay as they are."""
    if shift == 0.0:
        return telemetry
    moved = {}
    for name in ACTUATORS:
        if name in telemetry:
            values = telemetry[name]
            ahead = np.append(values[1:], values[-1:])
            moved[name] = np.where(np.isfinite(ahead), (1.0 - shift) * values + shift * ahead, values)
    return telemetry.with_columns(moved)
