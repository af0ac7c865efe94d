"""A Modbus unit whose every register tells by its content which register it is, and which records its writes."""

from __future__ import annotations

from collections.abc import Sequence

from igrow.edge.registers.model import Function
from igrow.edge.virtual_plc.memory import AnswerWithExceptionError

READABLE = range(256)
"""Addresses with coded content, in every table."""

WRITABLE = range(300, 400)
"""Holding registers that may be written."""


def code(device_id: int, function: Function, address: int) -> int:
    """Return a content (0 to 65535) that no other register of units 0 to 63 has; bits get its parity."""
    place = (device_id & 63) << 10 | (function is Function.INPUT) << 9 | address & 511
    scrambled = place * 40503 & 0xFFFF
    return bin(scrambled).count("1") & 1 if function.holds_bits else scrambled


class CodedUnit:
    """A unit for `igrow.edge.virtual_plc.modbus_server`."""

    def __init__(self, device_id: int, refused: Sequence[int] = ()) -> None:
        self.device_id = device_id
        self.refused = set(refused)
        self.reads: list[tuple[Function, int, int]] = []
        self.writes: list[tuple[Function, int, tuple[int, ...]]] = []
        self.failing_with: int | None = None

    def read(self, function: Function, address: int, count: int) -> Sequence[int]:
        self.reads.append((function, address, count))
        if self.failing_with:
            raise AnswerWithExceptionError(self.failing_with)
        asked = range(address, address + count)
        if asked.stop > READABLE.stop or self.refused & set(asked):
            raise AnswerWithExceptionError(2)
        return [code(self.device_id, function, a) for a in asked]

    def write(self, function: Function, address: int, values: Sequence[int]) -> None:
        if address not in WRITABLE:
            raise AnswerWithExceptionError(2)
        self.writes.append((function, address, tuple(values)))
