"""What was collected of one site: for each chain the receipt, and the newest segments' seals, in one small file."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from itertools import groupby
from pathlib import Path
from typing import Any

from igrow.core.errors import IgrowError
from igrow.core.exchange import Receipt, Segment, SegmentName
from igrow.core.exchange.documents import parse_object
from igrow.core.exchange.receipt import receipt_of
from igrow.core.whole_files import sync_folder, write_whole

KEPT = 100
"""Newest segments of a chain whose digests are remembered; what is older and comes again is merged again."""
RETURNS = 3
"""So often a chain goes on after another one, until two gateways are said to seal them."""


@dataclass(frozen=True)
class Link:
    """What is remembered of one segment."""

    digest: str
    previous: str
    start: float
    end: float


@dataclass
class Chain:
    """One chain of segments."""

    receipt: Receipt
    links: dict[int, Link] = field(default_factory=dict)
    given_up: set[int] = field(default_factory=set)


@dataclass
class SiteLedger:
    """The ledger of one site; `save` writes it."""

    path: Path
    site: str
    chains: dict[str, Chain] = field(default_factory=dict)
    """In the order in which the last segment of each came."""
    newest: datetime | None = None
    """Time of the newest row."""
    returns: int = 0
    """How often a chain went on, further than another one that had come after it."""

    def has(self, name: SegmentName) -> bool:
        """Tell whether this very segment was collected."""
        chain = self.chains.get(name.chain)
        link = None if chain is None else chain.links.get(name.number)
        return link is not None and link.digest == name.digest

    def receipt(self, chain: str) -> Receipt:
        """Return the receipt of a chain."""
        return self.chains[chain].receipt

    def add(self, segment: Segment) -> list[str]:
        """Note a segment; returns a sentence for each break of its chain."""
        name, seal = segment.name, segment.seal
        returned = self._returns(segment)
        self.returns += returned
        chain = self._chain(name.chain)
        notes = self._breaks(chain, segment)
        if returned and self.returns >= RETURNS:
            notes.append(
                f"segment {name.number} goes on with a chain that another one had followed, {self.returns} times: "
                f"do two gateways call themselves {self.site}? Their rows are mixed here; give one of them another name"
            )
        lost = [n for first, last in seal.given_up for n in range(first, last + 1) if not chain.receipt.holds(n)]
        if lost:
            chain.given_up.update(lost)
            notes.append(
                f"segments {_ranges(lost)} were deleted on the gateway, which had no room for them: their log is lost"
            )
        chain.links.setdefault(name.number, Link(name.digest, seal.previous, seal.start, seal.end))
        chain.receipt = chain.receipt.with_segments({**dict.fromkeys(lost, ""), name.number: name.digest})
        for number in sorted(chain.links)[:-KEPT]:
            del chain.links[number]
        if len(segment.telemetry):
            newest = datetime.fromtimestamp(int(segment.telemetry.time[-1].astype("int64")), UTC)
            self.newest = newest if self.newest is None else max(self.newest, newest)
        return notes

    def _returns(self, segment: Segment) -> bool:
        """Tell whether a chain goes on beyond the one that came last; a gateway that has begun another never does."""
        name, last = segment.name, next(reversed(self.chains), None)
        if last in (None, name.chain) or name.chain not in self.chains:
            return False
        furthest = max((link.end for link in self.chains[last].links.values()), default=math.inf)
        return name.number > max(self.chains[name.chain].links, default=0) and segment.seal.end > furthest

    def add_refused(self, name: SegmentName) -> None:
        """Note a segment that cannot be used: it is not wanted again."""
        chain = self._chain(name.chain)
        chain.links.setdefault(name.number, Link(name.digest, "", 0.0, 0.0))
        chain.receipt = chain.receipt.with_segments({name.number: name.digest})

    def missing(self) -> list[str]:
        """Return a sentence for each gap, with the days that it covers, in the chain that a segment came of last.

        A gateway that began another chain has sealed in it what it has still; nothing more comes of those before.
        """
        notes = []
        for chain in list(self.chains.values())[-1:]:
            for first, last in chain.receipt.gaps():
                before, after = chain.links.get(first - 1), chain.links.get(last + 1)
                days = f", {_day(before.end)} to {_day(after.start)}" if before and after else ""
                which = f"segment {first} has" if first == last else f"segments {first} to {last} have"
                notes.append(f"{which} not come yet{days}")
        return notes

    def _chain(self, name: str) -> Chain:
        """Return a chain, which is then the last one that a segment came of."""
        chain = self.chains.pop(name) if name in self.chains else Chain(Receipt(name))
        self.chains[name] = chain
        return chain

    def save(self) -> None:
        """Write the ledger, durably; raises OSError."""
        document = {
            "site": self.site,
            "returns": self.returns,
            "newest": None if self.newest is None else self.newest.timestamp(),
            "chains": [
                {
                    **chain.receipt.to_json(),
                    "given_up": sorted(chain.given_up),
                    "links": {str(n): [one.digest, one.previous, one.start, one.end] for n, one in chain.links.items()},
                }
                for chain in self.chains.values()
            ],
        }
        self.path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(self.path, json.dumps(document).encode())
        sync_folder(self.path.parent)

    @staticmethod
    def _breaks(chain: Chain, segment: Segment) -> list[str]:
        number, links = segment.name.number, chain.links
        before, here, after = links.get(number - 1), links.get(number), links.get(number + 1)
        if here is not None:
            return [f"two different segments have the number {number}, both are kept: was it restored from a backup?"]
        if (before is not None and before.digest and segment.seal.previous != before.digest) or (
            after is not None and after.previous and after.previous != segment.name.digest
        ):
            return [
                f"segment {number} does not follow the one that was collected: was the gateway restored from a backup?"
            ]
        return []


def read_ledger(archive: Path, site: str) -> SiteLedger:
    """Return a site's ledger, an empty one where there is none or where it is damaged.

    A ledger that is lost costs only that segments are merged again, which changes nothing.
    """
    path = archive / "ledger" / f"{site}.json"
    empty = SiteLedger(path, site)
    try:
        document = parse_object(path.read_bytes(), str(path))
        newest, returns = document["newest"], int(document.get("returns", 0))
        chains = {one["chain"]: _chain(one) for one in document["chains"]}
    except (IgrowError, OSError, KeyError, TypeError, ValueError, ArithmeticError):
        return empty
    return SiteLedger(path, site, chains, None if newest is None else datetime.fromtimestamp(newest, UTC), returns)


def _chain(one: dict[str, Any]) -> Chain:
    return Chain(
        receipt_of(one, one["chain"]), {int(n): Link(*link) for n, link in one["links"].items()}, set(one["given_up"])
    )


def _ranges(numbers: Iterable[int]) -> str:
    """Return numbers for people, those that follow each other as one range."""
    # Along such a range a number and its place grow alike.
    runs = [list(run) for _, run in groupby(enumerate(sorted(numbers)), lambda one: one[1] - one[0])]
    return ", ".join(f"{run[0][1]} to {run[-1][1]}" if len(run) > 1 else str(run[0][1]) for run in runs)


def _day(seconds: float) -> str:
    return f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%d}"
