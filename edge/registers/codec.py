"""Registers to values and back, for every data type and byte order. Pure, the same rules both ways."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence

from igrow.core.errors import IgrowError
from igrow.edge.registers.model import ByteOrder, DataType, Point

_FORMATS = {
    DataType.INT16: ">h",
    DataType.UINT16: ">H",
    DataType.INT32: ">i",
    DataType.UINT32: ">I",
    DataType.FLOAT32: ">f",
    DataType.INT64: ">q",
    DataType.UINT64: ">Q",
    DataType.FLOAT64: ">d",
}

REGISTER_TYPES = tuple(_FORMATS)
"""The data types that fill whole registers."""


_LEAST_NORMAL = {DataType.FLOAT32: 2.0**-126, DataType.FLOAT64: 2.0**-1022}
"""The smallest positive numbers of full precision (IEEE 754-2019, table 3.5)."""


class NotEncodableError(IgrowError):
    """The value does not fit the register: nothing was sent, and sending it again would not help."""


def decode_raw(registers: Sequence[int], data_type: DataType, order: ByteOrder = ByteOrder.ABCD) -> int | float:
    """Return the number that whole registers hold, before scale and offset.

    `registers` are the contents (0 to 65535) in the order of their addresses; there must be exactly
    `data_type.width` of them, else ValueError.
    """
    if len(registers) != data_type.width:
        raise ValueError(f"{data_type.value} takes {data_type.width} registers, got {len(registers)}")
    words = list(reversed(registers)) if order.words_reversed else registers
    packed = struct.pack(f"{'<' if order.bytes_swapped else '>'}{len(words)}H", *words)
    value: int | float = struct.unpack(_FORMATS[data_type], packed)[0]
    return value


def encode_raw(value: int | float, data_type: DataType, order: ByteOrder = ByteOrder.ABCD) -> tuple[int, ...]:
    """Return the registers, in the order of their addresses, that `decode_raw` reads as `value`.

    Raises NotEncodableError where the type cannot hold the value.
    """
    try:
        packed = struct.pack(_FORMATS[data_type], value)
    except (struct.error, OverflowError) as error:
        raise NotEncodableError(f"{value} does not fit {data_type.value}") from error
    words = struct.unpack(f"{'<' if order.bytes_swapped else '>'}{data_type.width}H", packed)
    return tuple(reversed(words)) if order.words_reversed else words


def decode(point: Point, content: Sequence[int]) -> float | None:
    """Return a point's value in its unit, or None where the device says that it has none.

    `content` is what the device answered for the point's addresses: registers, or bits as 0 and 1.
    A floating-point register that holds no finite number counts as "no value", and so does one that holds a number too
    small to be normal: no sensor measures that, but most round numbers look so when a device has changed the order of
    its words.
    """
    if point.type is DataType.BOOL:
        raw: int | float = int(content[0] != 0)
    elif point.type is DataType.BIT:
        raw = (content[0] >> point.bit) & 1
    else:
        raw = decode_raw(content, point.type, point.order)
        if raw == point.no_value or not math.isfinite(raw) or 0.0 < abs(raw) < _LEAST_NORMAL.get(point.type, 0.0):
            return None
    return raw * point.scale + point.offset


def turned(point: Point, content: Sequence[int]) -> float | None:
    """Return a number that tells, of what `decode` calls "no value", that the registers mean something else.

    They hold a number too small to be normal, and a possible one in the reverse order of their words; or it is a point
    that can be written, where nobody has put such a number. None where they may be meant so.
    """
    if point.type not in _LEAST_NORMAL:
        return None
    raw = float(decode_raw(content, point.type, point.order))
    if not 0.0 < abs(raw) < _LEAST_NORMAL[point.type]:
        return None
    value = decode(point, tuple(reversed(content)))
    if value is not None and value != 0.0 and point.low <= value <= point.high:
        return value
    return raw if point.writable else None


def encode(point: Point, value: float) -> tuple[int, ...]:
    """Return the registers (or the one bit) to write so that `decode` gives `value` back.

    Whole-number types are rounded to the nearest step of the scale. Raises NotEncodableError where the value is
    not finite, does not fit the type, or would read as "no value".
    """
    if not math.isfinite(value):
        raise NotEncodableError(f"{point.name}: {value} is no number that a register can hold")
    raw = (value - point.offset) / point.scale
    if point.type in (DataType.BOOL, DataType.BIT):
        if round(raw) not in (0, 1) or point.type is DataType.BIT:
            raise NotEncodableError(f"{point.name}: {value:g} does not fit one bit that can be written alone")
        return (round(raw),)
    number: int | float = raw if point.type in _LEAST_NORMAL else round(raw)
    if abs(number) < _LEAST_NORMAL.get(point.type, 0.0):
        number = 0.0  # what is smaller would read as "no value"
    if number == point.no_value:
        raise NotEncodableError(f"{point.name}: {value:g} would read as 'no value'")
    try:
        return encode_raw(number, point.type, point.order)
    except NotEncodableError as error:
        raise NotEncodableError(
            f"{point.name}: {value:g} does not fit {point.type.value} with scale {point.scale:g}"
        ) from error
