"""The exchange: where gateway and trainer leave files for each other.

A plain folder, on a disk that both see. A share over SFTP or S3 is mounted as a folder by the system (sshfs,
rclone), so that no protocol, no credential and no retry logic of theirs lives in the daemon.

    telemetry/<site>/<day>.csv.gz      one UTC day of the log           gateway -> trainer
    events/<site>/<day>.jsonl.gz       events, writes and alarms        gateway -> trainer
    reports/<site>/<time>-<name>.json  what became of a bundle          gateway -> trainer
    bundles/metadata, bundles/targets  signed bundles (TUF)             trainer -> gateway

Every file appears by a rename, whole. A day is published once it is over; on a stop also the day so far, which
the whole day replaces later.
"""

from __future__ import annotations

import gzip
import json
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from datetime import UTC, datetime
from pathlib import Path
from typing import Protocol

import numpy as np

from igrow.core.errors import IgrowError
from igrow.core.telemetry import write_csv
from igrow.core.whole_files import write_whole
from igrow.edge.store.store import read_records, read_telemetry

DAY = 86_400
GRACE_SECONDS = 120
"""A day is published this long after its end, when its last batch has been committed."""


class FlushingStore(Protocol):
    """What the exchange needs of the store."""

    folder: Path

    def flush(self) -> None:
        """Commit the rows in memory."""


class FolderExchange:
    """The exchange as a folder; implements `igrow.edge.ports.Exchange`."""

    def __init__(self, root: Path, site: str, store: FlushingStore) -> None:
        self._root = root
        self._site = site
        self._store = store
        self._state_file = store.folder / "exchange.json"
        self._published, self._sequence = _read_state(self._state_file)
        self._worker = ThreadPoolExecutor(1, thread_name_prefix="exchange")
        self._task: Future[None] | None = None
        self._problem = ""
        self._retry_at = 0.0
        self._newest = 0.0

    @property
    def bundles(self) -> Path:
        """The folder of the signed bundles."""
        return self._root / "bundles"

    @property
    def health(self) -> str:
        """Empty when all is well, else one line."""
        return self._problem

    def tick(self, time: float | None) -> None:
        """Publish the days that are complete at `time` (seconds since 1970 UTC); never blocks."""
        if time is None or (self._task is not None and not self._task.done()):
            return
        self._newest = time
        last_complete = int((time - GRACE_SECONDS) // DAY) - 1
        if last_complete > self._published and time >= self._retry_at:
            self._store.flush()
            self._task = self._worker.submit(self._publish_through, last_complete, time)

    def close(self) -> None:
        """Publish what is left, the day so far included, and stop."""
        self._store.flush()
        self._worker.shutdown(wait=True)
        if self._newest:
            today = int(self._newest // DAY)
            self._publish_through(today - 1, self._newest)
            self._guarded(lambda: self._publish_day(today, self._sequence), self._newest)

    def leave_report(self, time: float, name: str, content: Mapping[str, object]) -> None:
        """Leave a report for the trainer; raises OSError."""
        moment = datetime.fromtimestamp(time, UTC).strftime("%Y%m%dT%H%M%SZ")
        body = json.dumps(content, indent=2) + "\n"
        write_whole(self._folder("reports") / f"{moment}-{name}.json", body.encode())

    def _folder(self, kind: str) -> Path:
        """Return the site's folder of one kind of file, made where it is missing."""
        folder = self._root / kind / self._site
        folder.mkdir(parents=True, exist_ok=True)
        return folder

    def _publish_through(self, last: int, time: float) -> None:
        self._guarded(lambda: self._publish_days(last), time)

    def _guarded(self, work: object, time: float) -> None:
        assert callable(work)
        try:
            work()
        except (OSError, IgrowError) as error:
            self._problem = f"exchange {self._root}: {error}"
            self._retry_at = time + 600.0
        else:
            self._problem = ""

    def _publish_days(self, last: int) -> None:
        first = self._published + 1
        if self._published < 0:
            telemetry = read_telemetry(self._store.folder, 0, DAY * (last + 1))
            first = int(telemetry.time[0].astype(np.int64)) // DAY if len(telemetry) else last + 1
        for day in range(first, last + 1):
            self._sequence = self._publish_day(day, self._sequence)
            self._published = day
            state = {"published_through": str(_date(day)), "sequence": self._sequence}
            write_whole(self._state_file, json.dumps(state).encode())
        self._published = max(self._published, last)

    def _publish_day(self, day: int, sequence: int) -> int:
        """Write the files of one day; returns the sequence number of its newest record."""
        telemetry = read_telemetry(self._store.folder, DAY * day, DAY * (day + 1))
        if len(telemetry):
            write_csv(self._folder("telemetry") / f"{_date(day)}.csv.gz", telemetry)
        records = [
            record
            for category in ("event", "write", "alarm")
            # Not all of the ledger: over a season it outgrows the memory of a gateway.
            for record in read_records(self._store.folder, category, after=sequence)
            # A record without a time belongs to the first day that is published after it.
            if record.time is None or record.time < DAY * (day + 1)
        ]
        records.sort(key=lambda record: record.sequence)
        if records:
            lines = [
                json.dumps({"sequence": r.sequence, "category": r.category, "time": r.time, **r.body}) + "\n"
                for r in records
            ]
            write_whole(
                self._folder("events") / f"{_date(day)}.jsonl.gz", gzip.compress("".join(lines).encode(), mtime=0)
            )
        return records[-1].sequence if records else sequence


def _date(day: int) -> np.datetime64:
    return np.datetime64(day, "D")


def _read_state(path: Path) -> tuple[int, int]:
    """Return the last published day and record; a lost state costs only that days are written again."""
    try:
        state = json.loads(path.read_text())
        return int(np.datetime64(state["published_through"], "D").astype(np.int64)), int(state["sequence"])
    except (OSError, ValueError, KeyError, TypeError):
        return -1, 0
