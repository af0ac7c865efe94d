"""What a CO2 sensor must read under wide open vents: the CO2 of the outdoor air, less the little that a crop draws.

With an exchange of ten or more air changes an hour no crop keeps the air 80 ppm below the outdoor air. A sensor that
is off by more, from the first days of a log on, is off by a constant and does not drift.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from igrow.core.language import N_
from igrow.core.simulator.hybrid.record import Record
from igrow.trainer.diagnosis.rules import DecisionRules

PARTS = 3
"""Into which a log is cut, to tell what stands from its beginning."""


@dataclass(frozen=True)
class OpenVents:
    """Readings under wide open vents, in ppm over the outdoor air."""

    first: float
    """Median in the first part of the log."""
    last: float

    def is_offset(self, rules: DecisionRules) -> bool:
        """Tell whether the sensor is off from the beginning, by about as much at the end."""
        return abs(self.first) >= rules.open_vents_offset and abs(self.last - self.first) <= 0.5 * abs(self.first)

    @property
    def sentence(self) -> str:
        """For the grower."""
        off = 0.5 * (self.first + self.last)
        where = N_("below") if off < 0.0 else N_("above")
        return (
            f"with the vents wide open the CO2 sensor reads {abs(off):.0f} ppm {where} the outdoor air from the first "
            "days on, which is an offset of the sensor and no drift"
        )


def under_open_vents(record: Record, rules: DecisionRules) -> OpenVents | None:
    """Return what the CO2 sensor reads under wide open vents; None where they are hardly ever so open."""
    open_ = record.inputs["vent_lee"] + record.inputs["vent_wind"] >= rules.wide_open
    read = record.measured["air_co2"] - record.inputs["outdoor_co2"]
    # The air takes some minutes: the vents were as open in the step before.
    chosen = np.flatnonzero(open_[1:] & open_[:-1] & np.isfinite(read[1:])) + 1
    part = chosen * PARTS // max(len(record), 1)
    first, last = read[chosen[part == 0]], read[chosen[part == PARTS - 1]]
    if min(len(first), len(last)) < rules.open_rows:
        return None
    return OpenVents(float(np.median(first)), float(np.median(last)))
