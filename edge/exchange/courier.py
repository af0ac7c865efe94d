"""The courier: one round between the gateway's own disk and the exchange, as a process that may be ended at any time.

`python -m igrow.edge.exchange PARENT` reads its order as JSON from standard input, and ends when the process PARENT is
gone. Beside itself it needs nothing of the daemon: it reads the log as a second process, and answers in `status.json`.
"""

from __future__ import annotations

import fcntl
import json
import os
import resource
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from igrow.core.errors import IgrowError
from igrow.core.exchange import Below, ExchangeError, Place, SegmentName, read_receipt
from igrow.core.exchange.documents import LARGEST_DOCUMENT, parse_object
from igrow.core.exchange.signed_files import signed_files
from igrow.core.whole_files import write_whole
from igrow.edge.exchange.mounted import file_system_of
from igrow.edge.exchange.outbox import REPORTS, Outbox
from igrow.edge.exchange.places import open_place
from igrow.edge.exchange.sealing import notice, seal_due
from igrow.edge.parent import end_with_parent

STATUS_FILE = "status.json"
LARGEST_BUNDLE = 512 * 2**20
MOST_ROOTS = 1000
"""Versions of the root metadata; one a replaced key."""
LONGEST_WAIT = 60.0
"""Seconds that a round by hand waits for the daemon's own."""


@dataclass(frozen=True)
class Order:
    """What a round is to do."""

    folder: str
    """The exchange's part of the gateway's state: outbox, copies of the bundles, status."""
    store: str
    """The folder of log and ledger."""
    site: str
    url: str
    igrow_version: str
    time: float | None
    """The plant's time, seconds since 1970 UTC; None seals nothing."""
    period: int = 86_400
    """Seconds that a segment covers."""
    budget: int = 256 * 2**20
    """Bytes that the outbox may take."""
    partly: bool = False
    """Seal also what there is of a period that is not over."""
    known_hosts: str | None = None
    identity: str | None = None
    deadline: float = 600.0
    """Seconds after which the round is ended, wherever it is."""
    seen: tuple[float, float] | None = None
    """Lowest and highest time that the clock showed after it went back, where no round has noted it yet."""
    by_hand: bool = False
    """Wait for the daemon's own round, and let its exchange be what it was."""


@dataclass
class RoundStatus:
    """How the round ended, for the daemon and for people."""

    ended: float = 0.0
    """Wall clock, seconds since 1970 UTC."""
    problem: str = ""
    seen: tuple[float, float] | None = None
    """What of a clock that went back is noted on the disk."""
    sealed: int = 0
    sent: int = 0
    sent_bytes: int = 0
    receipted: int = 0
    given_up: int = 0
    waiting: int = 0
    """Segments that no receipt names yet."""
    waiting_bytes: int = 0
    file_system: str = ""
    """The address of the exchange while it is a disk or a share that is mounted."""


def run_round(order: Order, place: Place | None = None) -> RoundStatus:
    """Make one round and leave its status; never raises for a disk, a server or a file that fails."""
    folder = Path(order.folder)
    # A round that does not get far knows no more than the one before.
    status = _kept(_status_before(folder))
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with _alone(folder, LONGEST_WAIT if order.by_hand else 0.0):
            _round(order, folder, place, status)
    except (IgrowError, OSError) as error:
        text = error if isinstance(error, IgrowError) else error.strerror or str(error)
        status.problem = f"exchange {order.url}: {text}"
    status.ended = time.time()
    try:
        write_whole(folder / STATUS_FILE, json.dumps(asdict(status)).encode())
    except OSError as error:
        status.problem = status.problem or f"exchange: {folder}: {error.strerror}"
    return status


def _round(order: Order, folder: Path, place: Place | None, status: RoundStatus) -> None:
    outbox = Outbox(folder, order.site, order.igrow_version)
    try:
        outbox.move(notice(outbox.state, order.seen or ()))
        status.seen = order.seen
        if order.time is not None:
            status.sealed = seal_due(outbox, Path(order.store), order.time, order.period, partly=order.partly)
        place = place or open_place(order.url, known_hosts=order.known_hosts, identity=order.identity)
        # What is put into an empty mount point reaches nobody, and a report is sent only once.
        mounted = file_system_of(place, order.url, folder, status.file_system)
        # A stick does not take the place of the daemon's own exchange.
        status.file_system = status.file_system if order.by_hand else mounted
        _receive(outbox, place, order.site, status)
        _send(outbox, place, order.site, status)
        _send_reports(folder / REPORTS, place, order.site)
        mirror(Below(place, f"{order.site}/bundles"), folder / "bundles")
    finally:
        status.given_up = outbox.keep_within(order.budget)
        waiting = outbox.segments()
        status.waiting = len(waiting)
        status.waiting_bytes = sum(outbox.path(name).stat().st_size for name in waiting)


def _status_before(folder: Path) -> dict[str, Any]:
    """Return how the round before ended, as far as that can be read."""
    try:
        return parse_object((folder / STATUS_FILE).read_bytes(), STATUS_FILE)
    except (IgrowError, OSError):
        return {}


def _kept(before: dict[str, Any]) -> RoundStatus:
    """Return a status with what holds until a round knows better."""
    status = RoundStatus()
    for name in ("waiting", "waiting_bytes", "file_system"):
        if isinstance(before.get(name), type(getattr(status, name))):
            setattr(status, name, before[name])
    return status


def _receive(outbox: Outbox, place: Place, site: str, status: RoundStatus) -> None:
    """Take the receipts of the chains that segments wait of, and of the present one."""
    for chain in {outbox.state.chain, *(name.chain for name in outbox.segments())}:
        data = place.get(f"{site}/receipts/{chain}.json", LARGEST_DOCUMENT)
        if data is not None:
            try:
                status.receipted += outbox.take(read_receipt(data, chain))
            except IgrowError as error:
                # What cannot be read is no receipt: everything is kept, and sent.
                status.problem = f"exchange: {error}"


def _send(outbox: Outbox, place: Place, site: str, status: RoundStatus) -> None:
    """Send the segments that are not there."""
    waiting = outbox.segments()
    if not waiting:
        return
    there = {SegmentName.parse(entry.name) for entry in place.entries(f"{site}/segments")}
    for name in waiting:
        if name not in there and (content := outbox.content(name)) is not None:
            place.put(f"{site}/segments/{name}", content)
            status.sent += 1
            status.sent_bytes += len(content)


def _send_reports(reports: Path, place: Place, site: str) -> None:
    for path in sorted(reports.glob("*.json")):
        place.put(f"{site}/reports/{path.name}", path.read_bytes())
        path.unlink()


def mirror(place: Place, target: Path) -> int:
    """Copy the signed bundles to the gateway's own disk; returns how many files came anew.

    They are checked there, by their signatures (`igrow.edge.updates`). What is copied is what the timestamp leads to,
    whatever a listing shows, and the timestamp comes last: the copy is at every moment one that the publisher has
    signed. Raises ExchangeError where a file is missing, and then the copy stays what it was.
    """
    stamp = place.get("metadata/timestamp.json", LARGEST_DOCUMENT)
    file = target / "metadata" / "timestamp.json"
    if stamp is None or (file.exists() and file.read_bytes() == stamp):
        return 0
    signed, came = signed_files(place, stamp), 0
    roots = _roots(place)
    for name, content in {**roots, **signed.metadata}.items():
        came += _copy(target / "metadata" / name, content)
    for name, length in signed.archives.items():
        copy = target / "targets" / name
        if not copy.exists() or copy.stat().st_size != length:
            archive = place.get(f"targets/{name}", LARGEST_BUNDLE)
            if archive is None:
                raise ExchangeError(f"{place}/targets/{name}: is named by the signed metadata and not there")
            came += _copy(copy, archive)
    came += _copy(file, stamp)
    named = {*roots, *signed.metadata, *signed.archives, file.name}
    for path in target.glob("*/*"):
        if path.name not in named:
            path.unlink(missing_ok=True)
    return came


def _roots(place: Place) -> dict[str, bytes]:
    """Return all versions of the root metadata: a gateway follows them one by one from that which it trusts."""
    found: dict[str, bytes] = {}
    while len(found) < MOST_ROOTS:
        name = f"{len(found) + 1}.root.json"
        content = place.get(f"metadata/{name}", LARGEST_DOCUMENT)
        if content is None:
            break
        found[name] = content
    return found


def _copy(path: Path, content: bytes) -> int:
    """Write a file that is not there yet; returns 1 where it came anew."""
    if path.exists() and path.read_bytes() == content:
        return 0
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, content)
    return 1


@contextmanager
def _alone(folder: Path, longest: float) -> Iterator[None]:
    until = time.monotonic() + longest
    with (folder / "lock").open("w") as lock:
        while True:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                if time.monotonic() >= until:
                    raise IgrowError("another round is under way, or hangs") from None
                time.sleep(0.1)
        yield


def main(arguments: list[str]) -> int:
    """Read the order, make the round; the one argument is the process that asked for it, with which it ends."""

    def end(*_: object) -> None:
        # With all that it has started, such as `sftp`: it leads a session of its own.
        os.killpg(0, signal.SIGKILL)

    end_with_parent(int(arguments[0]), end)
    # Also for `sftp`: a server's listing or file may have no end. A file is held in memory, and packed once.
    resource.setrlimit(resource.RLIMIT_FSIZE, (LARGEST_BUNDLE, LARGEST_BUNDLE))
    resource.setrlimit(resource.RLIMIT_DATA, (2 * LARGEST_BUNDLE, 2 * LARGEST_BUNDLE))
    order = Order(**json.loads(sys.stdin.read()))
    signal.signal(signal.SIGALRM, end)
    signal.setitimer(signal.ITIMER_REAL, order.deadline)
    os.nice(10)
    return 1 if run_round(order).problem else 0
