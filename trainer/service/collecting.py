"""Collecting: what a gateway left in the exchange goes into the archive, once, and the gateway is told so.

For each segment: archive, ledger, receipt, then it is deleted from the exchange. Each of these steps is whole or not
at all and can be done again: a trainer that is killed between any two of them loses nothing and has nothing twice.
"""

from __future__ import annotations

import fcntl
import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from igrow.core.errors import IgrowError
from igrow.core.exchange import (
    DamagedError,
    ExchangeError,
    Place,
    Receipt,
    Segment,
    SegmentError,
    SegmentName,
    open_segment,
)
from igrow.core.exchange.segment import LARGEST_SEGMENT
from igrow.trainer.service.archive import Archive
from igrow.trainer.service.claim import claim
from igrow.trainer.service.ledger import SiteLedger, read_ledger

AHEAD = timedelta(days=1)
"""A row may be dated this far after the trainer's own clock; beyond that a clock was wrong."""
EARLIEST = np.datetime64("1980-01-01T00:00:00", "s")
LARGEST_REPORT = 2**20
SAVED_EVERY = 16
"""Segments between two receipts."""


@dataclass
class Collected:
    """What one run collected of one site."""

    site: str
    segments: int = 0
    rows: int = 0
    bytes: int = 0
    newest: datetime | None = None
    """Time of the newest row that was ever collected of this site."""
    notes: list[str] = field(default_factory=list)
    """One sentence for each thing that a person should know."""


def collect(
    place: Place, site: str, archive: Archive, now: datetime, *, take_over: bool = False, again: bool = False
) -> Collected:
    """Collect everything that site `site` left in the exchange; `take_over` where another archive has collected it.

    `again` sets days that cannot be read aside first, and asks the gateway for all that its log still has.
    Raises ExchangeError where the exchange fails, and IgrowError where another run, or another trainer, collects the
    same site.
    """
    done = Collected(site)
    with _alone(archive, site):
        claim(place, site, archive.root, now, take_over=take_over)
        ledger = read_ledger(archive.root, site)
        if again:
            _ask_again(place, archive, ledger, done)
        found = [name for entry in place.entries(f"{site}/segments") if (name := SegmentName.parse(entry.name))]
        found.sort(key=lambda name: (name.chain, name.number, name.digest))
        for begin in range(0, len(found), SAVED_EVERY):
            names = found[begin : begin + SAVED_EVERY]
            finished = [name for name in names if _collect_segment(place, name, archive, ledger, now, done)]
            ledger.save()
            for chain in {name.chain for name in finished}:
                content = json.dumps(ledger.receipt(chain).to_json()).encode()
                place.put(f"{site}/receipts/{chain}.json", content)
            for name in finished:
                place.delete(f"{site}/segments/{name}")
        _collect_reports(place, site, archive, done)
        done.notes += ledger.missing()
        done.newest = ledger.newest
    return done


def _ask_again(place: Place, archive: Archive, ledger: SiteLedger, done: Collected) -> None:
    """Take every receipt back: the gateway then seals its log from its first row on; what is here stays as it is."""
    done.notes += [f"{path}: could not be read, and is set aside" for path in archive.set_damaged_aside(ledger.site)]
    chains, ledger.chains = list(ledger.chains), {}
    ledger.save()
    for chain in chains:
        place.put(f"{ledger.site}/receipts/{chain}.json", json.dumps(Receipt(chain).to_json()).encode())
    done.notes.append("the gateway is asked for all that its log still has; its next rounds send it")


def _collect_segment(
    place: Place, name: SegmentName, archive: Archive, ledger: SiteLedger, now: datetime, done: Collected
) -> bool:
    """Bring one segment into archive and ledger; tell whether the exchange needs it no more."""
    site = ledger.site
    if ledger.has(name):
        return True
    data = place.get(f"{site}/segments/{name}", LARGEST_SEGMENT)
    if data is None:
        return False  # another run was quicker
    done.bytes += len(data)
    try:
        segment = open_segment(name, data, site)
    except DamagedError as error:
        # The gateway sees neither it nor a receipt, and sends it again.
        place.delete(f"{site}/segments/{name}")
        done.notes.append(f"{error}; the gateway sends it again")
        return False
    except SegmentError as error:
        path = archive.add_file("refused", site, str(name), data)
        ledger.add_refused(name)
        done.notes.append(f"segment {error}; set aside as {path}")
        return True
    _add(archive, segment, data, now, done)
    done.notes += ledger.add(segment)
    return True


def _add(archive: Archive, segment: Segment, data: bytes, now: datetime, done: Collected) -> None:
    """Add what a segment holds to the archive."""
    site, name = segment.seal.site, segment.name
    latest = np.datetime64((now + AHEAD).astimezone(UTC).replace(tzinfo=None), "s")
    telemetry, time = segment.telemetry.select(EARLIEST, latest), segment.telemetry.time
    wrong = time[(time < EARLIEST) | (time >= latest)]
    if len(wrong):
        span = f"{wrong[0]}" if len(wrong) == 1 else f"{wrong[0]} to {wrong[-1]}"
        path = archive.add_file("refused", site, str(name), data)
        done.notes.append(
            f"segment {name.number}: {len(wrong)} rows dated {span}, when the trainer's clock "
            f"shows {now:%Y-%m-%d}: a clock was wrong; set aside in {path}"
        )
    conflicts = archive.add_telemetry(site, telemetry)
    if conflicts:
        done.notes.append(
            f"segment {name.number}: {conflicts} values differ from those collected earlier for the same times, which "
            "stay: was the gateway restored from a backup, or its clock set back?"
        )
    if segment.foreign.columns:
        archive.add_telemetry(site, segment.foreign.select(EARLIEST, latest), kind="foreign")
        names = ", ".join(segment.foreign.columns)
        done.notes.append(f"segment {name.number}: {names}: no quantity and unit that this igrow knows; kept apart")
    otherwise = min(segment.seal.end, (now + AHEAD).timestamp())
    try:
        archive.add_events(site, segment.events, otherwise)
    except IgrowError as error:
        path = archive.add_file("refused", site, str(name), data)
        done.notes.append(f"segment {name.number}: its records are not used: {error}; set aside in {path}")
    done.segments += 1
    done.rows += len(telemetry)


def _collect_reports(place: Place, site: str, archive: Archive, done: Collected) -> None:
    """Move the reports on bundles into the archive; what is no report is set aside there too, and named when read."""
    for entry in place.entries(f"{site}/reports"):
        if not entry.name.endswith(".json"):
            continue
        try:
            content = place.get(f"{site}/reports/{entry.name}", LARGEST_REPORT)
        except ExchangeError as error:
            if entry.size <= LARGEST_REPORT:
                raise
            done.notes.append(f"report {entry.name} is not read: {error}")
            continue
        if content is not None:
            archive.add_file("reports", site, entry.name, content)
            place.delete(f"{site}/reports/{entry.name}")


@contextmanager
def _alone(archive: Archive, site: str) -> Iterator[None]:
    """Hold a site's part of the archive; raises IgrowError while another run has it."""
    folder: Path = archive.root / "ledger"
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / f"{site}.lock").open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise IgrowError(f"{site}: another run is collecting it now") from None
        yield
