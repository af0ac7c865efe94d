"""The log of one greenhouse as every model sees it: screened, on a regular grid, with what was set aside in words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from igrow.core.errors import IgrowError
from igrow.core.language import speak
from igrow.core.quantities import QUANTITIES
from igrow.core.simulator.hybrid.record import Record
from igrow.core.site import Site
from igrow.core.telemetry import Telemetry
from igrow.trainer.data import alignment
from igrow.trainer.data.fault import DataFault
from igrow.trainer.data.record import grid_record
from igrow.trainer.data.screening import NEEDED, Screened
from igrow.trainer.data.source import DailyTable
from igrow.trainer.given import Moment, moment

LEAST_DAYS = 7
"""Days that a log must span for anything to be fitted to it."""


@dataclass(frozen=True, repr=False)
class Log:
    """Telemetry on a regular grid, without what no model may be fitted to.

    Made by `read_log` from files, by `prepare_log` from a table in memory.
    """

    name: str
    telemetry: Telemetry
    """Screened, a row for each time of the grid, NaN where nothing is known."""
    site: Site | None = None
    """The greenhouse; None where neither the caller nor the log told it."""
    notes: tuple[str, ...] = ()
    """What was inferred or set aside, in sentences."""
    screened: tuple[Screened, ...] = ()
    """Stretches of single quantities that were set aside."""
    faults: tuple[DataFault, ...] = ()
    """Why no model may be fitted to it, with the mend; empty for a good log."""
    harvests: DailyTable | None = field(default=None)
    """See `igrow.trainer.data.source.Source`."""
    resources: DailyTable | None = field(default=None)
    """See `igrow.trainer.data.source.Source`."""

    def __repr__(self) -> str:
        table = self.telemetry
        if len(table) == 0:
            return f"Log({self.name!r}, empty)"
        first, last = (str(table.time[row].astype("datetime64[D]")) for row in (0, -1))
        aside = f", {len(self.screened)} stretches set aside" if self.screened else ""
        faulty = f", {len(self.faults)} data faults" if self.faults else ""
        step = f"every {table.step / 60.0:g} min"
        return f"Log({self.name!r}, {first} to {last} {step}, {len(table.columns)} quantities{aside}{faulty})"

    def __len__(self) -> int:
        return len(self.telemetry)

    @property
    def days(self) -> float:
        """Days from the first row to the last."""
        time = self.telemetry.time
        return float((time[-1] - time[0]).astype(np.int64)) / 86_400.0 if len(time) else 0.0

    @property
    def known_site(self) -> Site:
        """The site; raises IgrowError where it is not known."""
        if self.site is None:
            raise IgrowError(f"{self.name}: this log does not tell its greenhouse: give the site file with --site")
        return self.site

    def select(self, start: Moment | None = None, end: Moment | None = None) -> Log:
        """Return the part with start <= time < end, in UTC; None leaves that side open.

            log.select("2020-04-01")

        Raises:
            IgrowError: one of both is no time.
        """
        start, end = moment(start), moment(end)
        inside = tuple(
            one
            for one in self.screened
            if (start is None or one.end >= start) and (end is None or one.start < end)
        )  # fmt: skip
        return replace(self, telemetry=self.telemetry.select(start, end), screened=inside)

    def with_columns(self, columns: Mapping[str, Any]) -> Log:
        """Return the log with columns added, or put in the place of those with the same name, (n,) each."""
        return replace(self, telemetry=self.telemetry.with_columns(columns))

    def without(self, *names: str) -> Log:
        """Return the log without these columns; raises IgrowError where one is no quantity."""
        for name in names:
            if name not in QUANTITIES:
                raise IgrowError(f"{name!r} is no quantity; this log has {', '.join(self.telemetry.columns)}")
        return replace(
            self, telemetry=self.telemetry.only([name for name in self.telemetry.columns if name not in names])
        )

    def require(self, purpose: str, days: float = LEAST_DAYS) -> None:
        """Raise IgrowError with the reason why the log cannot serve a purpose ("a diagnosis"), if there is one."""
        if self.faults:
            raise IgrowError(f"{self.name}: " + "; ".join(map(str, self.faults)))
        for name in NEEDED:
            if name not in self.telemetry or not np.isfinite(self.telemetry[name]).any():
                hint = "`igrow-trainer import` tells which columns of an export are which"
                raise IgrowError(f"{self.name}: the log has no {name}: {purpose} needs it ({hint})")
        if self.days < days:
            raise IgrowError(f"{self.name}: the log spans {self.days:.1f} days: {purpose} needs at least {days:g}")

    def best_shift(self, parameters: Mapping[str, float]) -> float:
        """Return the rows by which the actuators are to be read ahead (`igrow.trainer.data.alignment`)."""
        return alignment.best_shift(self.telemetry, self.known_site, parameters)

    def record(self, shift: float = 0.0) -> Record:
        """Return the record on the working grid, its actuators read `shift` rows ahead.

        Raises:
            IgrowError: the site is not known, or the log lacks outdoor or air temperature.
        """
        return grid_record(self.telemetry, self.known_site, shift)

    def to_pandas(self) -> Any:
        """Return the telemetry as a `pandas.DataFrame`, its index the time in UTC."""
        import pandas as pd  # noqa: PLC0415  (slow to import)

        index = pd.DatetimeIndex(self.telemetry.time, tz="UTC", name="time")
        return pd.DataFrame(dict(self.telemetry.columns), index=index)

    def plot(self, path: str | Path | None = None) -> Any:
        """Return a matplotlib figure of the log with what was set aside, and write it to `path` where that is given."""
        from igrow.trainer.data.plot import plot_log  # noqa: PLC0415  (matplotlib is slow to import)

        language = speak("en", self.site.time_zone if self.site else "UTC")
        return plot_log(self.name, self.telemetry, self.screened, path, language=language)
