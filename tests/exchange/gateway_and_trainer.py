"""A gateway's store with its outbox, and a trainer's archive, around one exchange; every step is called by hand."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

from igrow.core.exchange import FolderPlace, Place
from igrow.edge.exchange import Order, run_round
from igrow.edge.exchange.courier import RoundStatus
from igrow.edge.image import Quality, Value
from igrow.edge.store import SqliteStore, StoreLimits
from igrow.trainer.service.archive import Archive
from igrow.trainer.service.collecting import Collected, collect

DAY = 86_400
START = 20_500 * DAY
"""2026-02-16, a midnight."""
SITE = "greenhouse"


class World:
    """One gateway and one trainer."""

    def __init__(self, folder: Path, place: Place | None = None, *, budget: int = 2**30, period: int = DAY) -> None:
        self.folder = folder
        self.site = SITE
        self.seen: tuple[float, float] | None = None
        """What the daemon saw of a clock that went back, and no round has noted yet."""
        self.place = place or FolderPlace(folder / "exchange")
        self.budget = budget
        self.period = period
        self.store = SqliteStore(folder / "store", StoreLimits(survive_power_cut=False))
        self.archive = Archive(folder / "archive")
        self.logged: dict[int, float] = {}
        """What the gateway measured: time -> value."""
        self.happened = 0
        """How many records the ledger has."""

    @property
    def outbox(self) -> Path:
        return self.folder / "state" / "exchange"

    def log(self, start: float, end: float, step: int = 600, *, value: float | None = None) -> None:
        """Let the gateway measure and note from start to end."""
        for time in range(int(start), int(end), step):
            measured = round(20.0 + 5.0 * np.sin(time / 9000.0), 2) if value is None else value
            self.store.append(time, {"air_temperature": Value(measured, Quality.GOOD, 0.0)})
            self.logged[time] = float(np.float32(measured))
        self.event(end, "checked")

    def event(self, time: float | None, kind: str) -> None:
        self.store.record_event(time, kind, {})
        self.happened += 1

    def round(self, time: float | None, *, partly: bool = False, place: Place | None = None) -> RoundStatus:
        """Let the courier make a round at this time."""
        self.store.flush()
        order = Order(
            str(self.outbox), str(self.store.folder), self.site, "exchange", "0.1.0", time, self.period,
            self.budget, partly, seen=self.seen,
        )  # fmt: skip
        status = run_round(order, place or self.place)
        if status.seen == self.seen:
            self.seen = None
        return status

    def run_days(self, first: int, last: int) -> None:
        """Let whole days pass, each with a round after it."""
        for day in range(first, last):
            self.log(START + day * DAY, START + (day + 1) * DAY)
            self.round(START + (day + 1) * DAY + 300)

    def collect(self, now: float, place: Place | None = None, *, take_over: bool = False) -> Collected:
        moment = datetime.fromtimestamp(now, UTC)
        return collect(place or self.place, self.site, self.archive, moment, take_over=take_over)

    def archived(self) -> dict[int, float]:
        """Return what the trainer holds, row by row as any program reads it; a repeated row is an error."""
        rows: dict[int, float] = {}
        for path in sorted((self.archive.root / "telemetry" / f"site={self.site}").rglob("*.parquet")):
            table = pq.ParquetFile(path).read()
            for time, value in zip(
                table["time"].to_numpy().astype("datetime64[s]").astype(int).tolist(),
                table["air_temperature"].to_pylist(),
                strict=True,
            ):
                assert time not in rows, f"{time} stands twice in {path}"
                rows[time] = value
        return rows

    def sequences(self) -> list[int]:
        """Return the sequence numbers of the archived records."""
        found: list[int] = []
        for path in sorted((self.archive.root / "events" / f"site={self.site}").rglob("*.parquet")):
            found += pq.ParquetFile(path).read()["sequence"].to_pylist()
        return sorted(found)

    def assert_complete(self) -> None:
        """The trainer holds every row and every record once."""
        assert self.archived() == self.logged
        assert self.sequences() == list(range(1, self.happened + 1))

    def waiting(self) -> list[str]:
        """Return the names of the outbox's segments."""
        return sorted(path.name for path in (self.outbox / "segments").iterdir())


def report(**content: object) -> Mapping[str, object]:
    return {"site": SITE, "verdict": "adopted", "identity": "a" * 64, **content}
