"""Reads planned blocks, and learns which addresses a device refuses: a block that dies on one is split, for good."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from igrow.edge.bus.errors import AddressRefusedError, BusError
from igrow.edge.bus.protocol import Bus, Priority, ReadRequest
from igrow.edge.registers.model import Device, Point, needed_for_control
from igrow.edge.registers.read_planner import Block, plan_reads, split

_log = logging.getLogger(__name__)

Content = tuple[int, ...]
Results = dict[str, tuple[Content | None, BusError | None, float]]
"""What became of each point, by name: its registers or bits, or the error, and when (monotonic seconds)."""

MOST_PLANS = 256
"""Plans kept: one for each set of points that were ever due together."""

ASK_REFUSED_AGAIN = 10.0, 600.0
"""Seconds after which a point whose address was refused is asked for again, at first and at the most: a PLC that starts
may refuse for a while what it has, and a program may be loaded at any time."""


def _priority(block: Block) -> Priority:
    return Priority.CONTROL if any(needed_for_control(point.name) for point in block.points) else Priority.LOG


@dataclass(frozen=True, slots=True)
class _Refused:
    """A point whose address was refused."""

    error: AddressRefusedError
    wait: float
    """Seconds for which it is not asked for."""
    until: float
    """Monotonic seconds."""


class BlockReader:
    """Reads points of one bus in as few requests as its devices allow."""

    def __init__(self, bus: Bus, devices: Mapping[str, Device], monotonic: Callable[[], float]) -> None:
        self._bus = bus
        self._devices = devices
        self._monotonic = monotonic
        self._plans: dict[frozenset[str], tuple[Block, ...]] = {}
        self._pieces: dict[Block, tuple[Block, Block]] = {}
        self._refused: dict[str, _Refused] = {}

    async def read(self, points: Iterable[Point]) -> Results:
        """Return for every point, by name, its registers or bits or the error, and the monotonic time of it."""
        results: Results = {}
        for block in self._plan(tuple(points)):
            await self._read_block(block, results)
        return results

    def _plan(self, points: tuple[Point, ...]) -> tuple[Block, ...]:
        key = frozenset(point.name for point in points)
        if key not in self._plans:
            if len(self._plans) >= MOST_PLANS:
                self._plans.clear()
                self._pieces.clear()
            self._plans[key] = tuple(sorted(plan_reads(points, self._devices), key=_priority))
        return self._plans[key]

    async def _read_block(self, block: Block, results: Results) -> None:
        known = self._pieces.get(block)
        if known is not None:
            for piece in known:
                await self._read_block(piece, results)
            return
        refused = self._refused.get(block.points[0].name)
        if refused is not None and self._monotonic() < refused.until:
            results.update(dict.fromkeys(block.names, (None, refused.error, self._monotonic())))
            return
        device = self._devices[block.device]
        request = ReadRequest(device.device_id, block.function, block.address, block.count)
        try:
            content = await self._bus.read(request, _priority(block))
        except AddressRefusedError as error:
            await self._split_and_read(block, error, results)
        except BusError as error:
            results.update(dict.fromkeys(block.names, (None, error, self._monotonic())))
        else:
            at = self._monotonic()
            for point in block.points:
                self._refused.pop(point.name, None)
                results[point.name] = (block.content_of(point, content), None, at)

    async def _split_and_read(self, block: Block, error: AddressRefusedError, results: Results) -> None:
        try:
            pieces = split(block)
        except ValueError:
            first, most = ASK_REFUSED_AGAIN
            for point in block.points:
                before = self._refused.get(point.name)
                if before is None:
                    _log.warning("%s cannot be read: %s", point.name, error)
                wait = first if before is None else min(2.0 * before.wait, most)
                self._refused[point.name] = _Refused(error, wait, self._monotonic() + wait)
                results[point.name] = (None, error, self._monotonic())
            return
        self._pieces[block] = pieces
        _log.info("%s: reading %s and %s apart from now on", error, *(piece.points[0].name for piece in pieces))
        for piece in pieces:
            await self._read_block(piece, results)
