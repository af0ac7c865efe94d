"""What a reader returns: the telemetry of one greenhouse as it was read, and what was booked beside it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from igrow.core.arrays import Floats, Times
from igrow.core.site import Site
from igrow.core.telemetry import Telemetry
from igrow.trainer.data.fault import DataFault


@dataclass(frozen=True)
class DailyTable:
    """A small table of local calendar days."""

    day: Times
    """datetime64[D], strictly increasing, (n,)."""
    columns: Mapping[str, Floats]
    """By name, (n,), NaN where missing."""

    def __getitem__(self, name: str) -> Floats:
        """Return one column; raises KeyError where the table lacks it."""
        return self.columns[name]

    def __contains__(self, name: object) -> bool:
        return name in self.columns

    def __len__(self) -> int:
        return len(self.day)


@dataclass(frozen=True)
class Source:
    """The log of one greenhouse compartment, nothing set aside yet."""

    name: str
    telemetry: Telemetry
    harvests: DailyTable | None = None
    """``class_a`` and ``class_b``: kg m-2 fresh weight of that day's harvest, not cumulative."""
    resources: DailyTable | None = None
    """Any of ``heat`` (MJ m-2), ``electricity_peak``, ``electricity_off_peak``, ``electricity`` (kWh m-2),
    ``co2`` (kg m-2), ``irrigation``, ``drain`` (L m-2), all per day."""
    site: Site | None = None
    """What is known of the greenhouse, where the kind of log tells it."""
    notes: tuple[str, ...] = field(default=())
    """What the reader set aside or inferred, in words."""
    faults: tuple[DataFault, ...] = field(default=())
    """What rows in time cannot show any more, such as rows that contradict each other."""
