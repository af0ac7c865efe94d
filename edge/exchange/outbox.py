"""The outbox: sealed segments on the gateway's own disk, kept until the trainer's receipt, within a budget of bytes.

`chain.json` says how far the log is sealed. A segment counts from the moment that its file is there: where the power
fails before `chain.json` follows, the newest segment's own seal tells the rest.

A chain ends where its numbers no longer say what the trainer has: this gateway or the trainer was restored from a
backup, the site was renamed, a segment was lost here. Another chain then begins, and the log is sealed from its first
row on; what the trainer has already, it recognises.
"""

from __future__ import annotations

import contextlib
import json
import math
import secrets
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from igrow.core.errors import IgrowError
from igrow.core.exchange import DamagedError, Receipt, Seal, SegmentError, SegmentName, open_segment, pack_segment
from igrow.core.exchange.documents import parse_object
from igrow.core.exchange.segment import peek_seal
from igrow.core.quantities import QUANTITIES
from igrow.core.telemetry import Telemetry
from igrow.core.whole_files import sync_folder, write_whole

CHAIN_FILE = "chain.json"
SEGMENTS, REPORTS = "segments", "reports"


@dataclass(frozen=True)
class ChainState:
    """How far the log is sealed."""

    chain: str
    number: int = 0
    """Of the newest segment."""
    digest: str = ""
    through: int = 0
    """All rows before this time are sealed (seconds since 1970 UTC); 0 when none is."""
    sequence: int = 0
    """All records of the ledger up to this one are sealed."""
    sealed_at: float = 0.0
    """Plant's time of the newest seal."""
    behind: tuple[float, float] | None = None
    """While the clock shows times that are sealed already: from when to when it did."""
    given_up: tuple[tuple[int, int], ...] = ()
    """Numbers of segments deleted for want of space before a receipt came."""
    site: str = ""
    """Whose log the chain seals; empty where that was not noted yet."""


class Outbox:
    """The outbox in one folder. Methods raise OSError for a disk that fails."""

    def __init__(self, folder: Path, site: str, igrow_version: str) -> None:
        """Read where the chain stands; begin one where there is none."""
        self.folder = folder
        self._site = site
        self._version = igrow_version
        (folder / SEGMENTS).mkdir(parents=True, exist_ok=True)
        (folder / REPORTS).mkdir(exist_ok=True)
        self.state = self._recover(_read_state(folder / CHAIN_FILE))
        if self.state.site not in ("", site):
            self.begin_again()
        earlier = [name for name in self.segments() if name.chain != self.state.chain]
        self._seal_again([name for name in earlier if self._site_of(name) != site])
        self.move(replace(self.state, site=site))

    def segments(self) -> list[SegmentName]:
        """Return what waits, oldest first."""
        found = [SegmentName.parse(path.name) for path in (self.folder / SEGMENTS).iterdir()]
        return sorted((name for name in found if name), key=lambda name: (name.chain != self.state.chain, name.number))

    def path(self, name: SegmentName) -> Path:
        """Return a segment's file."""
        return self.folder / SEGMENTS / str(name)

    def seal(
        self,
        start: int,
        end: int,
        telemetry: Telemetry,
        events: Sequence[Mapping[str, object]],
        *,
        through: int,
        sequence: int,
        sealed_at: float,
    ) -> SegmentName:
        """Write the next segment and move on; raises OSError, and then nothing has happened."""
        state = self.state
        blank = Seal(
            site=self._site,
            chain=state.chain,
            number=state.number + 1,
            previous=state.digest,
            start=float(start),
            end=float(end),
            through=float(through),
            igrow_version=self._version,
            columns={name: QUANTITIES[name].unit for name in telemetry.columns},
            rows=0,
            telemetry_digest="",
            records=0,
            events_digest="",
            last_sequence=sequence,
            given_up=state.given_up,
        )
        name, data = pack_segment(blank, telemetry, events)
        write_whole(self.path(name), data)
        sync_folder(self.folder / SEGMENTS)
        self.move(
            replace(
                state,
                number=name.number,
                digest=name.digest,
                through=through,
                sequence=sequence,
                sealed_at=sealed_at,
            )
        )
        return name

    def move(self, state: ChainState) -> None:
        """Remember a new state, durably."""
        if state != self.state:
            write_whole(self.folder / CHAIN_FILE, json.dumps(asdict(state)).encode())
            sync_folder(self.folder)
            self.state = state

    def content(self, name: SegmentName) -> bytes | None:
        """Return a segment's file, None where the disk has spoilt it: it is deleted then, and missed by `take`."""
        content = self.path(name).read_bytes()
        if name.is_of(content):
            return content
        self.path(name).unlink(missing_ok=True)
        return None

    def take(self, receipt: Receipt) -> int:
        """Forget what the trainer holds; returns how many segments that were.

        A receipt of the present chain that does not fit what this outbox has sealed ends the chain.
        """
        if receipt.chain == self.state.chain:
            if self._is_of_others(receipt) or self._lacks(receipt):
                self.begin_again()
                return 0
            left = tuple(one for one in self.state.given_up if not all(map(receipt.holds, range(one[0], one[1] + 1))))
            self.move(replace(self.state, given_up=left))
        taken = [
            name
            for name in self.segments()
            if name.chain == receipt.chain
            and (name.number <= receipt.through or receipt.beyond.get(name.number) == name.digest)
        ]
        for name in taken:
            self.path(name).unlink(missing_ok=True)
        return len(taken)

    def _is_of_others(self, receipt: Receipt) -> bool:
        """Tell whether a receipt names segments that this outbox did not seal: its memory is that of a backup."""
        mine = {name.number: name.digest for name in self.segments() if name.chain == receipt.chain}
        mine[self.state.number] = self.state.digest
        named = {**receipt.beyond, receipt.anchor[0]: receipt.anchor[1]}
        return max(receipt.through, *named) > self.state.number or any(
            mine.get(number, digest) != digest for number, digest in named.items()
        )

    def _lacks(self, receipt: Receipt) -> bool:
        """Tell whether neither trainer nor outbox has a segment: an earlier receipt named it, or the disk lost it."""
        known = {name.number for name in self.segments() if name.chain == receipt.chain}
        known |= {number for first, last in self.state.given_up for number in range(first, last + 1)}
        later = range(receipt.through + 1, self.state.number + 1)
        return any(not receipt.holds(number) and number not in known for number in later)

    def begin_again(self) -> None:
        """Begin another chain, of which the log is sealed from its first row on, and before it all that waits."""
        chain = ChainState(secrets.token_hex(6), sealed_at=self.state.sealed_at, site=self._site)
        old = self.segments()
        self.move(chain)
        self._seal_again(old)

    def _seal_again(self, names: Sequence[SegmentName]) -> None:
        """Seal what waits in other segments as segments of the present chain: the log may have it no more."""
        for name in names:
            with contextlib.suppress(SegmentError, DamagedError):
                old = open_segment(name, self.path(name).read_bytes(), self._site_of(name))
                self.seal(
                    int(old.seal.start), int(old.seal.end), old.telemetry, old.events,
                    through=self.state.through, sequence=self.state.sequence, sealed_at=self.state.sealed_at,
                )  # fmt: skip
            self.path(name).unlink(missing_ok=True)

    def _site_of(self, name: SegmentName) -> str:
        """Return whose log a segment that waits has sealed, empty where the disk has spoilt it."""
        try:
            return peek_seal(self.path(name).read_bytes()).site
        except SegmentError:
            return ""

    def keep_within(self, budget: int) -> int:
        """Delete the oldest segments above `budget` bytes, never the newest; returns how many that were."""
        names = self.segments()
        sizes = {name: self.path(name).stat().st_size for name in names}
        total, dropped = sum(sizes.values()), 0
        for name in names[:-1]:
            if total <= budget:
                break
            if name.chain == self.state.chain:
                # Said first, deleted then: a segment may be lost, but not without a word.
                self.move(replace(self.state, given_up=_extended(self.state.given_up, name.number)))
            self.path(name).unlink(missing_ok=True)
            total -= sizes[name]
            dropped += 1
        return dropped

    def _recover(self, state: ChainState | None) -> ChainState:
        """Return the state, moved on by segments that were written and not yet noted."""
        mine = [n for n in map(SegmentName.parse, (p.name for p in (self.folder / SEGMENTS).iterdir())) if n]
        if state is None:
            if not mine:
                state = ChainState(secrets.token_hex(6), site=self._site)
                self.state = replace(state, number=-1)  # so that the first move writes it
                self.move(state)
                return state
            newest = max(mine, key=lambda name: self.path(name).stat().st_mtime_ns)
            state = ChainState(newest.chain)
        for name in sorted(mine, key=lambda one: one.number):
            if name.chain == state.chain and name.number > state.number:
                try:
                    seal = peek_seal(self.path(name).read_bytes())
                except SegmentError:
                    self.path(name).unlink(missing_ok=True)  # flash rot; its rows are in the log still
                    continue
                state = replace(
                    state,
                    number=name.number,
                    digest=name.digest,
                    through=int(seal.through),
                    sequence=seal.last_sequence,
                    given_up=seal.given_up,
                    site=seal.site,
                )
        return state


def _extended(ranges: tuple[tuple[int, int], ...], number: int) -> tuple[tuple[int, int], ...]:
    if ranges and ranges[-1][1] == number - 1:
        return (*ranges[:-1], (ranges[-1][0], number))
    return (*ranges, (number, number))


def _read_state(path: Path) -> ChainState | None:
    """Return the state, None where it is lost."""
    try:
        document = parse_object(path.read_bytes(), str(path))
        behind = document["behind"]
        state = ChainState(
            str(document["chain"]),
            int(document["number"]),
            str(document["digest"]),
            int(document["through"]),
            int(document["sequence"]),
            float(document["sealed_at"]),
            None if behind is None else (float(behind[0]), float(behind[1])),
            tuple((int(first), int(last)) for first, last in document["given_up"]),
            str(document.get("site", "")),
        )
    except (IgrowError, OSError, LookupError, TypeError, ValueError, ArithmeticError):
        return None
    return state if all(map(math.isfinite, (state.sealed_at, *(state.behind or ())))) else None
