"""The read planner: few requests, every point once, nothing that a device cannot bear."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from igrow.edge.registers.model import DataType, Device, Function, Point
from igrow.edge.registers.read_planner import Block, plan_reads, split

NAMES = [f"point_{number}" for number in range(60)]


def device(name: str = "plc", **more: object) -> Device:
    return Device(name, "bus", 1, **more)  # type: ignore[arg-type]


def register(name: str, address: int, data_type: DataType = DataType.UINT16, on: str = "plc") -> Point:
    return Point(name, on, Function.HOLDING, address, data_type)


def spans(blocks: tuple[Block, ...]) -> list[tuple[int, int]]:
    return [(block.address, block.count) for block in blocks]


@pytest.mark.parametrize(
    ("addresses", "limits", "expected"),
    [
        ([], {}, []),
        ([7], {}, [(7, 1)]),
        ([0, 1, 2], {}, [(0, 3)]),
        ([2, 0, 1], {}, [(0, 3)]),
        ([0, 9], {"bridge": 8}, [(0, 10)]),
        ([0, 10], {"bridge": 8}, [(0, 1), (10, 1)]),
        ([0, 1, 2, 3], {"longest_block": 2}, [(0, 2), (2, 2)]),
        ([0, 2, 4], {"unreadable": ((Function.HOLDING, 3, 3),)}, [(0, 3), (4, 1)]),
        ([0, 2, 4], {"unreadable": ((Function.INPUT, 3, 3),)}, [(0, 5)]),
        ([0, 200], {"bridge": 500}, [(0, 1), (200, 1)]),
    ],
    ids=[
        "nothing",
        "one",
        "neighbours",
        "any order",
        "a gap of the bridge's length",
        "a gap longer than the bridge",
        "longest block",
        "unreadable hole",
        "hole in another table",
        "never above 125 registers",
    ],
)
def test_points_are_gathered(addresses: list[int], limits: dict[str, Any], expected: list[tuple[int, int]]) -> None:
    points = [register(f"p{address}", address) for address in addresses]
    assert spans(plan_reads(points, {"plc": device(**limits)})) == expected


def test_a_long_value_is_not_cut() -> None:
    points = [register("a", 0), register("b", 1, DataType.FLOAT64)]
    assert spans(plan_reads(points, {"plc": device(longest_block=4)})) == [(0, 1), (1, 4)]


def test_bits_of_one_register_share_one_address() -> None:
    points = [Point(f"b{bit}", "plc", Function.INPUT, 5, DataType.BIT, bit=bit) for bit in range(4)]
    (block,) = plan_reads(points, {"plc": device()})
    assert (block.address, block.count, len(block.points)) == (5, 1, 4)


def test_two_devices_never_share_a_request() -> None:
    points = [register("a", 0), register("b", 1, on="other")]
    assert len(plan_reads(points, {"plc": device(), "other": device("other")})) == 2


points_strategy = st.lists(
    st.builds(
        lambda on, function, address, data_type: (on, function, address, data_type),
        st.sampled_from(["one", "two"]),
        st.sampled_from(list(Function)),
        st.integers(0, 400),
        st.sampled_from([DataType.UINT16, DataType.FLOAT32, DataType.FLOAT64]),
    ),
    max_size=60,
)


@given(
    points_strategy,
    st.integers(4, 125),
    st.integers(0, 40),
    st.lists(st.tuples(st.sampled_from(list(Function)), st.integers(0, 400), st.integers(0, 20)), max_size=5),
)
def test_every_plan_keeps_the_rules(
    raw: list[tuple[str, Function, int, DataType]],
    longest: int,
    bridge: int,
    holes: list[tuple[Function, int, int]],
) -> None:
    unreadable = tuple((function, first, first + length) for function, first, length in holes)
    devices = {
        name: device(name, longest_block=longest, longest_bit_block=longest, bridge=bridge, unreadable=unreadable)
        for name in ("one", "two")
    }
    points = [
        Point(name, on, function, address, DataType.BOOL if function.holds_bits else data_type)
        for name, (on, function, address, data_type) in zip(NAMES, raw, strict=False)
    ]
    blocks = plan_reads(points, devices)
    assert sorted(p.name for b in blocks for p in b.points) == sorted(p.name for p in points)
    for block in blocks:
        assert {(p.device, p.function) for p in block.points} == {(block.device, block.function)}
        assert 1 <= block.count <= longest
        covered = {a for p in block.points for a in range(p.address, p.end)}
        assert covered <= set(range(block.address, block.address + block.count))
        bridged = set(range(block.address, block.address + block.count)) - covered
        assert not any(
            function is block.function and first <= address <= last
            for function, first, last in unreadable
            for address in bridged
        )
        content = tuple(range(block.address, block.address + block.count))
        for point in block.points:
            assert block.content_of(point, content) == tuple(range(point.address, point.end))


def test_a_refused_block_is_cut_at_its_widest_gap() -> None:
    (block,) = plan_reads([register("a", 0), register("b", 2), register("c", 8)], {"plc": device()})
    assert [spans((piece,)) for piece in split(block)] == [[(0, 3)], [(8, 1)]]


def test_a_refused_block_without_gaps_is_halved() -> None:
    (block,) = plan_reads([register(f"p{a}", a) for a in range(4)], {"plc": device()})
    assert [spans((piece,)) for piece in split(block)] == [[(0, 2)], [(2, 2)]]


def test_one_point_cannot_be_cut() -> None:
    (block,) = plan_reads([register("a", 0, DataType.FLOAT64)], {"plc": device()})
    with pytest.raises(ValueError, match="cannot be cut"):
        split(block)
