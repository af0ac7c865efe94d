"""From telemetry to the record that is diagnosed: screened, aligned, on the diagnosis grid."""

from __future__ import annotations

import numpy as np

from igrow.core.quantities import ACTUATORS
from igrow.core.simulator.hybrid.record import Record
from igrow.core.site import Site
from igrow.core.telemetry import Telemetry
from igrow.trainer.diagnosis import alignment, linearisation
from igrow.trainer.diagnosis.deployed import Deployed


def shift_actuators(telemetry: Telemetry, shift: float) -> Telemetry:
    """Return the log with its actuators read `shift` rows (0, 0.5 or 1) ahead."""
    if shift == 0.0:
        return telemetry
    moved = {}
    for name in ACTUATORS:
        if name in telemetry:
            values = telemetry[name]
            ahead = np.append(values[1:], values[-1:])
            moved[name] = np.where(np.isfinite(ahead), (1.0 - shift) * values + shift * ahead, values)
    return telemetry.with_columns(moved)


def open_record(telemetry: Telemetry, site: Site, deployed: Deployed) -> tuple[Record, float]:
    """Return the record of a log, and by how many rows its actuators were read ahead."""
    shift = alignment.best_shift(telemetry, site, deployed.parameters) if deployed.shift is None else deployed.shift
    return linearisation.diagnosis_record(shift_actuators(telemetry, shift), site), shift
