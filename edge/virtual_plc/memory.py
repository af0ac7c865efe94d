"""The registers of one virtual device, laid out by a register map."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from igrow.edge.registers.codec import NotEncodableError, decode, encode, encode_raw
from igrow.edge.registers.model import DataType, Function, Point, RegisterMap

ILLEGAL_ADDRESS = 2


class AnswerWithExceptionError(Exception):
    """The device answers a request with this Modbus exception code."""

    def __init__(self, code: int) -> None:
        super().__init__(f"exception {code}")
        self.code = code


class Table:
    """One of the four tables: consecutive addresses, some of which may be refused."""

    def __init__(self, spans: Sequence[tuple[int, int]], refused: Sequence[tuple[int, int]] = ()) -> None:
        """`spans` are the addresses in use: first, and first behind; `refused` both ends."""
        self.first = min((first for first, _ in spans), default=0)
        end = max((end for _, end in spans), default=0)
        self.content = [0] * (end - self.first)
        self._refused = refused

    def read(self, address: int, count: int) -> list[int]:
        """Return `count` registers or bits; raises AnswerWithExceptionError for an address that is not there."""
        start = address - self.first
        refused = self._refused and any(first < address + count and address <= last for first, last in self._refused)
        if start < 0 or start + count > len(self.content) or refused:
            raise AnswerWithExceptionError(ILLEGAL_ADDRESS)
        return self.content[start : start + count]

    def put(self, address: int, values: Sequence[int]) -> None:
        """Store registers or bits; raises AnswerWithExceptionError for an address that is not there."""
        self.read(address, len(values))
        start = address - self.first
        self.content[start : start + len(values)] = values


class DeviceMemory:
    """The four tables of one device of a register map, read and written by address (clients) or name (the PLC)."""

    def __init__(self, register_map: RegisterMap, device: str) -> None:
        unreadable, identity = register_map.devices[device].unreadable, register_map.devices[device].identity
        self.points: Mapping[str, Point] = {
            name: point for name, point in register_map.points.items() if point.device == device
        }
        self.tables = {
            function: Table(
                [(point.address, point.end) for point in self.points.values() if point.function is function]
                + [(one.address, one.end) for one in (identity,) if one is not None and one.function is function],
                [(first, last) for table, first, last in unreadable if table is function],
            )
            for function in Function
        }
        if identity is not None:
            self.tables[identity.function].put(identity.address, identity.content)
        self._writable = {
            (point.function, address)
            for point in self.points.values()
            if point.writable
            for address in range(point.address, point.end)
        }

    def read(self, function: Function, address: int, count: int) -> list[int]:
        """Answer a client's read."""
        return self.tables[function].read(address, count)

    def write(self, function: Function, address: int, values: Sequence[int]) -> None:
        """Do a client's write; refused where the map has nothing writable."""
        for offset in range(len(values)):
            if (function, address + offset) not in self._writable:
                raise AnswerWithExceptionError(ILLEGAL_ADDRESS)
        self.tables[function].put(address, values)

    def value(self, name: str) -> float | None:
        """Return a point's present value in its unit."""
        point = self.points[name]
        return decode(point, self.tables[point.function].read(point.address, point.type.width))

    def set_value(self, name: str, value: float) -> None:
        """Publish a value; one that the registers cannot hold becomes "no value", or the nearest that they can."""
        point = self.points[name]
        table = self.tables[point.function]
        if point.type is DataType.BIT:
            (word,) = table.read(point.address, 1)
            mask = 1 << point.bit
            table.put(point.address, [word | mask if value >= 0.5 else word & ~mask])
            return
        try:
            table.put(point.address, encode(point, value))
        except NotEncodableError:
            table.put(point.address, _substitute(point, value))


def _substitute(point: Point, value: float) -> tuple[int, ...]:
    """Return what a device shows that cannot show `value`: "no value" for NaN (off, of one bit), or its scale's end."""
    if point.type is DataType.BOOL:
        return (int(value >= 0.5),)
    if point.type in (DataType.FLOAT32, DataType.FLOAT64):
        return encode_raw(math.nan, point.type, point.order)
    if math.isnan(value):
        return encode_raw(point.no_value or 0, point.type, point.order)
    upwards = value > point.offset if point.scale > 0 else value < point.offset
    bits = 16 * point.type.width
    if point.type in (DataType.INT16, DataType.INT32, DataType.INT64):
        return encode_raw(2 ** (bits - 1) - 1 if upwards else -(2 ** (bits - 1)), point.type, point.order)
    return encode_raw(2**bits - 1 if upwards else 0, point.type, point.order)
