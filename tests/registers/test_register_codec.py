"""Registers to values and back: the same rules both ways, for every type and byte order."""

from __future__ import annotations

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from igrow.edge.registers.codec import REGISTER_TYPES, NotEncodableError, decode, decode_raw, encode, encode_raw
from igrow.edge.registers.model import ByteOrder, DataType, Function, Point

ORDERS = st.sampled_from(list(ByteOrder))
WHOLE = {
    DataType.INT16: (-(2**15), 2**15 - 1),
    DataType.UINT16: (0, 2**16 - 1),
    DataType.INT32: (-(2**31), 2**31 - 1),
    DataType.UINT32: (0, 2**32 - 1),
    DataType.INT64: (-(2**63), 2**63 - 1),
    DataType.UINT64: (0, 2**64 - 1),
}


def point(data_type: DataType, **more: object) -> Point:
    return Point("air_temperature", "plc", Function.HOLDING, 0, data_type, **more)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("data_type", "order", "registers", "value"),
    [
        (DataType.INT16, ByteOrder.ABCD, (0xFFFE,), -2),
        (DataType.UINT16, ByteOrder.BADC, (0x3412,), 0x1234),
        (DataType.UINT32, ByteOrder.ABCD, (0x0A0B, 0x0C0D), 0x0A0B0C0D),
        (DataType.UINT32, ByteOrder.CDAB, (0x0C0D, 0x0A0B), 0x0A0B0C0D),
        (DataType.UINT32, ByteOrder.BADC, (0x0B0A, 0x0D0C), 0x0A0B0C0D),
        (DataType.UINT32, ByteOrder.DCBA, (0x0D0C, 0x0B0A), 0x0A0B0C0D),
        (DataType.FLOAT32, ByteOrder.ABCD, (0x41BC, 0x0000), 23.5),
        (DataType.FLOAT32, ByteOrder.CDAB, (0x0000, 0x41BC), 23.5),
        (DataType.UINT64, ByteOrder.CDAB, (0x0708, 0x0506, 0x0304, 0x0102), 0x0102030405060708),
        (DataType.UINT64, ByteOrder.DCBA, (0x0807, 0x0605, 0x0403, 0x0201), 0x0102030405060708),
    ],
)
def test_known_contents_read_as_the_specified_value(
    data_type: DataType, order: ByteOrder, registers: tuple[int, ...], value: float
) -> None:
    assert decode_raw(registers, data_type, order) == value
    assert encode_raw(value, data_type, order) == registers


@given(st.sampled_from(REGISTER_TYPES), ORDERS, st.data())
def test_every_content_survives_decoding_and_encoding(
    data_type: DataType, order: ByteOrder, data: st.DataObject
) -> None:
    words = st.integers(0, 0xFFFF)
    registers = tuple(data.draw(st.lists(words, min_size=data_type.width, max_size=data_type.width)))
    value = decode_raw(registers, data_type, order)
    if not (isinstance(value, float) and math.isnan(value)):
        assert encode_raw(value, data_type, order) == registers


@given(st.sampled_from(list(WHOLE)), ORDERS, st.data())
def test_every_whole_number_of_the_type_survives(data_type: DataType, order: ByteOrder, data: st.DataObject) -> None:
    value = data.draw(st.integers(*WHOLE[data_type]))
    assert decode_raw(encode_raw(value, data_type, order), data_type, order) == value


@given(st.sampled_from(list(WHOLE)), ORDERS)
def test_one_beyond_the_type_is_refused(data_type: DataType, order: ByteOrder) -> None:
    low, high = WHOLE[data_type]
    for value in (low - 1, high + 1):
        with pytest.raises(NotEncodableError):
            encode_raw(value, data_type, order)


@given(ORDERS, st.floats(width=32, allow_nan=False, allow_infinity=False, allow_subnormal=False))
def test_a_float32_travels_exactly_in_every_order(order: ByteOrder, value: float) -> None:
    assert decode(point(DataType.FLOAT32, order=order), encode(point(DataType.FLOAT32, order=order), value)) == value


@given(st.integers(-32768, 32767), st.sampled_from([0.1, 0.01, 2.0, -0.5]), st.sampled_from([0.0, -40.0, 273.15]))
def test_a_scaled_value_comes_back_within_half_a_step(raw: int, scale: float, offset: float) -> None:
    scaled = point(DataType.INT16, scale=scale, offset=offset)
    value = raw * scale + offset
    back = decode(scaled, encode(scaled, value))
    assert back == pytest.approx(value, abs=abs(scale) / 2)
    assert encode(scaled, value) == encode_raw(raw, DataType.INT16)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e39])
def test_what_a_float32_cannot_hold_is_refused(value: float) -> None:
    with pytest.raises(NotEncodableError):
        encode(point(DataType.FLOAT32), value)


def test_a_value_that_would_read_as_no_value_is_refused() -> None:
    with pytest.raises(NotEncodableError, match="no value"):
        encode(point(DataType.INT16, no_value=-32768), -32768.0)


@pytest.mark.parametrize("value", [18.0, 20.25, 0.5, 612.0, -7.75])
def test_a_number_whose_words_a_device_has_swapped_reads_as_no_value(value: float) -> None:
    swapped = struct.unpack(">HH", struct.pack(">f", value))[::-1]
    assert decode(point(DataType.FLOAT32), swapped) is None
    assert decode(point(DataType.FLOAT32), (0, 0)) == 0.0
    assert encode(point(DataType.FLOAT32), 1e-41) == (0, 0)


def test_the_no_value_content_and_nan_read_as_none() -> None:
    assert decode(point(DataType.INT16, no_value=0x7FFF), (0x7FFF,)) is None
    assert decode(point(DataType.FLOAT32), struct.unpack(">HH", struct.pack(">f", math.nan))) is None
    assert decode(point(DataType.FLOAT32), struct.unpack(">HH", struct.pack(">f", math.inf))) is None


@given(st.integers(0, 0xFFFF), st.integers(0, 15))
def test_a_bit_of_a_register_is_that_bit(word: int, bit: int) -> None:
    assert decode(point(DataType.BIT, bit=bit), (word,)) == float(f"{word:016b}"[15 - bit])


def test_a_coil_takes_only_zero_and_one() -> None:
    coil = Point("rain", "plc", Function.COIL, 0, DataType.BOOL)
    assert (encode(coil, 0.0), encode(coil, 1.0)) == ((0,), (1,))
    with pytest.raises(NotEncodableError):
        encode(coil, 2.0)


def test_a_wrong_number_of_registers_is_a_programming_error() -> None:
    with pytest.raises(ValueError, match="takes 2 registers"):
        decode_raw((1,), DataType.FLOAT32)
