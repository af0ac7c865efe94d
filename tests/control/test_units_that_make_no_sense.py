"""A PLC whose program has been changed: its registers mean something else, so nothing may be written to it."""

from __future__ import annotations

import asyncio
import struct
from collections.abc import Callable, Mapping

import pytest

from igrow.edge.bus.plc import RegisterPlc
from igrow.edge.image import Image
from igrow.edge.registers.loading import parse_register_map
from igrow.edge.registers.model import Function
from igrow.edge.sensors import ImageBuilder, default_rule
from igrow.edge.sensors.sense import CALM
from tests.bus.plc_bench import INTERVAL, PlcBench, RecordingUnit, make_plc_bench
from tests.bus.simulated_loop import run
from tests.control.control_fakes import FixedSource

HEATING = 21.299999237060547
"""As a float32 holds 21.3: no round number in either order."""
WISH = {"heating_setpoint": HEATING, "co2_setpoint": 700.0, "lamp_on": 1.0, "irrigation_on": 0.5}
SAFE = {"heating_setpoint": 18.0, "co2_setpoint": 400.0}


def turned(words: list[int]) -> list[int]:
    return [words[index ^ 1] for index in range(len(words))]


class Updated:
    """The PLC after an update: `shows` makes of its registers what a client reads of them."""

    def __init__(self, unit: RecordingUnit, shows: Callable[[list[int]], list[int]], *functions: Function) -> None:
        self.unit, self.usual = unit, unit.read

        def read(function: Function, address: int, count: int) -> list[int]:
            if function not in functions or address > 5 or (function is Function.HOLDING and address > 3):
                return self.usual(function, address, count)
            table = unit.tables[function]
            end = 4 if function is Function.HOLDING else 6
            words = shows(self.usual(function, 0, end)) + table.content[end:]
            return words[address : address + count]

        unit.read = read

    def undo(self) -> None:
        self.unit.read = self.usual


async def cycles(bench: PlcBench, number: int) -> None:
    for _ in range(number):
        await bench.cycle.run()
        await asyncio.sleep(INTERVAL)


def written(bench: PlcBench) -> dict[str, int]:
    """Return how often each point of the first unit was written."""
    return {name: len(rows) for name, rows in bench.units["plc"].received.items()}


def alarms(bench: PlcBench) -> list[str]:
    return [record.text for record in bench.cycle._journal.alarms.active]


def moved_by_one(words: list[int]) -> list[int]:
    return [0, *words[:-1]]


@pytest.mark.parametrize("shows", [turned, moved_by_one])
@pytest.mark.parametrize("functions", [(Function.HOLDING,), (Function.INPUT,), (Function.HOLDING, Function.INPUT)])
def test_nothing_is_written_to_a_plc_whose_registers_mean_something_else(
    shows: Callable[[list[int]], list[int]], functions: tuple[Function, ...]
) -> None:
    """Where the setpoints alone are turned, or the sensors alone, or all of them."""

    async def played() -> None:
        bench = await make_plc_bench([FixedSource(dict(WISH))], two_buses=True, respect_hand=600.0)
        await cycles(bench, 8)
        assert {name: bench.stands(name) for name in WISH} == WISH
        unit = bench.units["plc"]
        for number, name in enumerate(("air_temperature", "air_humidity", "air_co2")):
            # As sensors are: no round numbers.
            unit.set_value(name, (20.3, 81.7, 613.3)[number])
        update, before = Updated(unit, shows, *functions), written(bench)
        await cycles(bench, 20)
        assert written(bench) == before, "neither a setpoint nor the heartbeat"
        (text,) = [text for text in alarms(bench) if "make no sense" in text]
        assert "unit plc" in text
        other = len(bench.received("lamp_on"))
        for name, value in SAFE.items():
            unit.set_value(name, value)  # its own watchdog
        await cycles(bench, 5)
        assert written(bench) == before
        assert len(bench.received("lamp_on")) == other, "the other unit stands where it should"
        update.undo()
        await cycles(bench, int(CALM / INTERVAL) + 12)
        assert {name: bench.stands(name) for name in WISH} == WISH
        assert not {"changed_by_hand", "plc_restarted"} & set(bench.store.kinds())
        assert not [text for text in alarms(bench) if "make no sense" in text]
        await bench.close()

    run(played())


def test_a_stop_leaves_a_plc_that_makes_no_sense_to_itself_and_says_so() -> None:
    async def played() -> None:
        bench = await make_plc_bench([FixedSource(dict(WISH))], two_buses=True, respect_hand=600.0)
        await cycles(bench, 8)
        Updated(bench.units["plc"], turned, Function.HOLDING, Function.INPUT)
        await cycles(bench, 2)
        before = written(bench)
        report, _ = await bench.stop()
        assert written(bench) == before
        assert bench.stands("lamp_on") == 0.0, "the other unit gets its safe values"
        assert set(report.failed) == set(SAFE)
        assert "make no sense" in report.words()
        await bench.close()

    run(played())


def test_another_device_at_the_address_of_the_plc_gets_nothing_written() -> None:
    """Its registers count: as numbers of two words they are all too small to be normal, in either order."""

    async def played() -> None:
        bench = await make_plc_bench([FixedSource(dict(WISH))], two_buses=True, respect_hand=600.0)
        await cycles(bench, 8)
        bench.units["plc"].read = lambda function, address, count: [address + place for place in range(count)]
        before = written(bench)
        await cycles(bench, 40)
        assert written(bench) == before
        await bench.close()

    run(played())


def test_a_daemon_that_starts_on_such_a_plc_writes_nothing_to_it_at_all() -> None:
    async def played() -> None:
        bench = await make_plc_bench([FixedSource(dict(WISH))], two_buses=True, respect_hand=600.0)
        Updated(bench.units["plc"], turned, Function.HOLDING, Function.INPUT)
        await cycles(bench, 40)
        assert written(bench) == {}
        assert bench.stands("lamp_on") == WISH["lamp_on"]
        await bench.close()

    run(played())


TEXT = """
title: a climate computer
source: none
buses:
  line: {transport: tcp, host: 127.0.0.1}
devices:
  plc: {bus: line, device_id: 1}
points:
"""
POINTS = {
    "air_temperature": "degC", "air_humidity": "%", "air_co2": "ppm", "par": "umol m-2 s-1", "wind_speed": "m s-1",
    "global_radiation": "W m-2", "outdoor_temperature": "degC",
}  # fmt: skip


def images_of(shown: list[Mapping[str, float]], order: str = "ABCD") -> list[Image]:
    """Return the images, ten seconds apart, of a unit that shows these numbers in another order of words."""
    lines = [
        f"  {name}: {{device: plc, function: input, address: {2 * place}, type: float32, order: {order}, "
        f'unit: "{unit}"}}'
        for place, (name, unit) in enumerate(POINTS.items())
    ]
    register_map = parse_register_map(TEXT + "\n".join(lines))
    now, holds = [0.0], dict[str, float]()

    class Bus:
        async def read(self, request: object, priority: object) -> tuple[int, ...]:
            first, count = request.address, request.count  # type: ignore[attr-defined]
            words = struct.unpack(">14H", struct.pack(">7f", *(holds[name] for name in POINTS)))
            return words[first : first + count]

    plc = RegisterPlc(register_map, monotonic=lambda: now[0], buses={"line": Bus()})  # type: ignore[dict-item]
    rules = {name: default_rule(name, poll_period=10.0) for name in POINTS}
    builder = ImageBuilder(rules, units=dict.fromkeys(POINTS, "plc"))
    images = []
    for row in shown:
        now[0] += 10.0
        holds.update(row)
        images.append(builder.build(asyncio.run(plc.read()), now[0], None))
    return images


GOOD = {
    "air_temperature": 20.3, "air_humidity": 81.7, "air_co2": 612.9, "par": 0.0, "wind_speed": 3.2,
    "global_radiation": 0.0, "outdoor_temperature": 7.4,
}  # fmt: skip


@pytest.mark.parametrize(
    "fault",
    [
        dict.fromkeys(GOOD, 0.0),
        dict.fromkeys(GOOD, -9999.0),
        dict.fromkeys(GOOD, float("nan")),
        {"air_temperature": 1e9, "air_humidity": -1e9},
        {"par": 3e-41, "global_radiation": 5e-41},
        {"air_co2": 3.3e38},
    ],
)
def test_sensors_that_fail_do_not_make_a_unit_senseless(fault: Mapping[str, float]) -> None:
    """A filter that decays in the dark, a broken sensor or two, all of them lost at once."""
    assert not any(image.senseless for image in images_of([GOOD, {**GOOD, **fault}, {**GOOD, **fault}, GOOD]))


def test_numbers_that_make_sense_have_to_do_so_for_a_while() -> None:
    """Of numbers in another order some are possible by chance."""
    images = images_of([GOOD] * 3, order="CDAB")
    assert all("plc" in image.senseless for image in images)
    assert images_of([GOOD] * 3)[-1].senseless == {}
