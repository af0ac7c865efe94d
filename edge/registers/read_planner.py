"""Gathers points into as few read requests as their devices allow. Pure: no bus, no clock."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import groupby

from igrow.edge.registers.model import Device, Function, Point


@dataclass(frozen=True, eq=False)
class Block:
    """One read request and the points that its answer serves. Two blocks are the same if they are one object."""

    device: str
    function: Function
    address: int
    count: int
    points: tuple[Point, ...]
    """In the order of their addresses; never empty."""

    @property
    def names(self) -> list[str]:
        """Names of the points."""
        return [point.name for point in self.points]

    def content_of(self, point: Point, content: tuple[int, ...]) -> tuple[int, ...]:
        """Cut one point's registers or bits out of the whole block's answer."""
        start = point.address - self.address
        return content[start : start + point.type.width]


def block_of(points: Iterable[Point]) -> Block:
    """Return the one block that covers points of one device and one table."""
    ordered = tuple(sorted(points, key=lambda point: (point.address, point.end, point.name)))
    first = ordered[0]
    end = max(point.end for point in ordered)
    return Block(first.device, first.function, first.address, end - first.address, ordered)


def plan_reads(points: Iterable[Point], devices: Mapping[str, Device]) -> tuple[Block, ...]:
    """Return blocks that read every point exactly once.

    A block stays on one device and in one table, is no longer than the device bears, spans at most the
    device's `bridge` unused addresses between two points, and spans none that the device is known to refuse.
    """

    def table(point: Point) -> tuple[str, str]:
        return point.device, point.function.value

    blocks: list[Block] = []
    for _, members in groupby(sorted(points, key=table), key=table):
        blocks.extend(_gather(sorted(members, key=lambda point: (point.address, point.end, point.name)), devices))
    return tuple(blocks)


def _gather(ordered: list[Point], devices: Mapping[str, Device]) -> list[Block]:
    device = devices[ordered[0].device]
    limit = device.block_limit(ordered[0].function)
    gathered: list[list[Point]] = []
    start = end = 0
    for point in ordered:
        joins = (
            bool(gathered)
            and point.address - end <= device.bridge
            and max(end, point.end) - start <= limit
            and not _refused(device, point.function, end, point.address)
        )
        if joins:
            gathered[-1].append(point)
            end = max(end, point.end)
        else:
            gathered.append([point])
            start, end = point.address, point.end
    return [block_of(members) for members in gathered]


def _refused(device: Device, function: Function, start: int, end: int) -> bool:
    """Tell whether the gap [start, end) holds an address that the device is known to refuse."""
    return any(table is function and first < end and start <= last for table, first, last in device.unreadable)


def split(block: Block) -> tuple[Block, Block]:
    """Cut a refused block in two: at its widest gap, else in the middle of its points.

    Points that share registers stay together. Raises ValueError for a block that cannot be cut.
    """
    cuts: list[tuple[int, int, int]] = []
    end = block.points[0].end
    for index, point in enumerate(block.points[1:], start=1):
        if point.address >= end:
            cuts.append((point.address - end, -abs(2 * index - len(block.points)), index))
        end = max(end, point.end)
    if not cuts:
        raise ValueError("a block of one point, or of points that share registers, cannot be cut")
    index = max(cuts)[2]
    return block_of(block.points[:index]), block_of(block.points[index:])
