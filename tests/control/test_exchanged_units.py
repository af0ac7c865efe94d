"""Two units of one layout that change places: never written to under the other's name, and no hand lost or invented."""

from __future__ import annotations

import asyncio

import pytest

from igrow.edge.bus.plc import Reading
from igrow.edge.guard import Finding, Outcome, Readback
from igrow.edge.registers.loading import parse_register_map
from igrow.edge.registers.look_alikes import look_alikes
from igrow.edge.registers.model import Function
from igrow.edge.sensors import ImageBuilder, SensorRule
from tests.bus.fault_proxy import Fault
from tests.bus.plc_bench import INTERVAL, RULES, SAFE, PlcBench, make_plc_bench
from tests.bus.simulated_loop import run
from tests.control.control_fakes import FixedSource

WISH = {"heating_setpoint": 21.5, "co2_setpoint": 700.0, "lamp_on": 1.0, "irrigation_on": 0.5}


def change_places_when(bench: PlcBench, device: str) -> None:
    """Change places in the middle of a reading: when this unit's setpoints were read."""
    unit = bench.units[device]
    usual = unit.read

    def read(function: Function, address: int, count: int) -> list[int]:
        words = usual(function, address, count)
        if function is Function.HOLDING:
            unit.read = usual
            asyncio.get_running_loop().call_soon(bench.change_places)
        return words

    unit.read = read


async def cycles(bench: PlcBench, number: int) -> None:
    for _ in range(number):
        await bench.cycle.run()
        await asyncio.sleep(INTERVAL)


def received(bench: PlcBench) -> int:
    return sum(len(rows) for unit in bench.units.values() for rows in unit.received.values())


def alarms(bench: PlcBench) -> list[str]:
    return [record.text for record in bench.cycle._journal.alarms.active if record.name.startswith("registers")]


async def controlled(*, two_buses: bool, respect_hand: float = 600.0) -> PlcBench:
    bench = await make_plc_bench([FixedSource(dict(WISH))], two_buses=two_buses, respect_hand=respect_hand)
    await cycles(bench, 8)
    assert {name: bench.stands(name) for name in WISH} == WISH
    return bench


@pytest.mark.parametrize("two_buses", [False, True])
def test_units_that_change_places_get_nothing_until_each_is_itself_again(two_buses: bool) -> None:
    async def played() -> None:
        bench = await controlled(two_buses=two_buses)
        before = received(bench)
        bench.change_places()
        await cycles(bench, 30)
        assert received(bench) == before, "neither a setpoint nor the heartbeat"
        (text,) = alarms(bench)
        assert "units other and plc show each other's setpoints" in text
        bench.change_places()
        await cycles(bench, 8)
        assert not alarms(bench)
        assert {name: bench.stands(name) for name in WISH} == WISH
        assert received(bench) > before
        assert not {"changed_by_hand", "plc_restarted"} & set(bench.store.kinds())
        await bench.close()

    run(played())


@pytest.mark.parametrize("first_read", ["plc", "other"])
@pytest.mark.parametrize("two_buses", [False, True])
def test_units_that_change_places_in_the_middle_of_a_reading_are_not_taken_for_themselves(
    first_read: str, two_buses: bool
) -> None:
    async def played() -> None:
        bench = await controlled(two_buses=two_buses)
        before = received(bench)
        change_places_when(bench, first_read)
        await cycles(bench, 20)
        assert received(bench) <= before + 1, "a heartbeat of the cycle in which both were still themselves"
        assert alarms(bench)
        bench.change_places()
        await cycles(bench, 8)
        assert not {"changed_by_hand", "plc_restarted"} & set(bench.store.kinds())
        await bench.close()

    run(played())


def test_units_that_have_fallen_back_before_they_change_places_are_known_by_their_safe_values() -> None:
    """As after a service: the power was off for a while."""

    async def played() -> None:
        bench = await controlled(two_buses=True)
        for proxy in bench.proxies.values():
            proxy.next_fault = lambda: Fault.NO_ANSWER
        await cycles(bench, 12)
        for name, value in SAFE.items():
            bench.unit_of(name).set_value(name, value)
        bench.change_places()
        before = received(bench)
        for proxy in bench.proxies.values():
            del proxy.__dict__["next_fault"]
        await cycles(bench, 60)
        assert received(bench) == before
        assert len(alarms(bench)) == 1
        bench.change_places()
        await cycles(bench, 8)
        assert {name: bench.stands(name) for name in WISH} == WISH
        assert "changed_by_hand" not in bench.store.kinds()
        await bench.close()

    run(played())


def test_units_that_change_places_while_no_daemon_is_there_are_told_at_its_start() -> None:
    async def played() -> None:
        bench = await controlled(two_buses=False)
        bench.change_places()
        before = received(bench)
        await bench.restart(600.0)
        await cycles(bench, 10)
        assert received(bench) == before
        assert alarms(bench)
        await bench.close()

    run(played())


def test_a_unit_that_answers_under_the_number_of_one_that_is_gone_gets_nothing() -> None:
    async def played() -> None:
        bench = await controlled(two_buses=False)
        numbers = bench.numbers[0]
        numbers[1] = numbers.pop(2)
        before = received(bench)
        await cycles(bench, 60)
        assert received(bench) == before
        assert "unit plc shows the setpoints of unit other" in alarms(bench)[0]
        await bench.close()

    run(played())


def test_a_stop_leaves_units_that_have_changed_places_alone_and_says_why() -> None:
    async def played() -> None:
        bench = await controlled(two_buses=False)
        bench.change_places()
        before = received(bench)
        report, _ = await bench.stop()
        assert received(bench) == before
        assert set(report.failed) == set(SAFE)
        assert "show each other's setpoints" in report.words()
        await bench.close()

    run(played())


def test_a_hand_is_respected_when_its_unit_is_back_in_its_place() -> None:
    async def played() -> None:
        bench = await controlled(two_buses=False, respect_hand=6000.0)
        bench.unit_of("co2_setpoint").set_value("co2_setpoint", 555.0)
        await cycles(bench, 4)
        assert bench.store.kinds().count("changed_by_hand") == 1
        bench.change_places()
        await cycles(bench, 10)
        bench.change_places()
        await cycles(bench, 8)
        assert bench.store.kinds().count("changed_by_hand") == 1
        assert bench.stands("co2_setpoint") == 555.0
        await bench.close()

    run(played())


SWITCHES = """
title: two units with one switch each
source: none
buses:
  line: {transport: tcp, host: 127.0.0.1}
devices:
  lamps: {bus: line, device_id: 1}
  water: {bus: line, device_id: 2}
points:
  lamp_on: {device: lamps, function: holding, address: 0, type: float32, unit: "1", writable: true}
  irrigation_on: {device: water, function: holding, address: 0, type: float32, unit: "1", writable: true}
"""


class Watched:
    """What the read-back finds in the readings of two units with one setpoint each."""

    def __init__(self, **shows: float) -> None:
        register_map = parse_register_map(SWITCHES)
        units = {name: point.device for name, point in register_map.points.items()}
        rules = {name: RULES[name] for name in units}
        self.builder = ImageBuilder({name: SensorRule(-1e6, 1e6, stale_after=30.0) for name in units}, units=units)
        self.readback = Readback(
            rules, confirm_within=60.0, respect_hand=600.0, units=units, look_alikes=look_alikes(register_map, units)
        )
        self.now = 1000.0
        self.shows = dict(shows)
        self.found: list[Finding] = []
        self.understood = True

    def read(self, *names: str) -> None:
        readings = {name: Reading(self.shows[name], None, self.now) for name in names or self.shows}
        image = self.readback.recognised(self.builder.build(readings, self.now, None))
        self.understood = all(image.makes_sense(name) for name in self.shows)
        self.found += self.readback.observe(image, patient=True)

    def cycle(self, **shows: float) -> None:
        """Read all, and at once again what has to be looked at."""
        self.now, self.shows = self.now + 10.0, self.shows | shows
        self.read()
        again = self.readback.unseen(self.builder.build({}, self.now, None))
        if again:
            self.now += 0.1
            self.read(*again)

    def hands(self) -> dict[str, float | None]:
        return {found.point: found.shown for found in self.found if found.outcome is Outcome.BY_HAND}


def test_a_hand_that_sets_what_another_unit_shows_is_a_hand() -> None:
    plant = Watched(lamp_on=0.25, irrigation_on=0.5)
    plant.cycle()
    plant.cycle(lamp_on=0.5)
    plant.cycle()
    assert plant.hands() == {"lamp_on": 0.5}
    assert plant.understood
    plant.cycle(irrigation_on=0.25)
    plant.cycle()
    assert plant.hands() == {"lamp_on": 0.5, "irrigation_on": 0.25}


def test_two_switches_that_are_set_the_other_way_round_at_once_are_hands() -> None:
    """Where nothing but on and off is shown, an exchange looks like what people do."""
    plant = Watched(lamp_on=1.0, irrigation_on=0.0)
    plant.cycle()
    plant.cycle(lamp_on=0.0, irrigation_on=1.0)
    plant.cycle()
    assert plant.hands() == {"lamp_on": 0.0, "irrigation_on": 1.0}


def test_two_numbers_exchanged_in_one_reading_are_no_hands() -> None:
    plant = Watched(lamp_on=0.25, irrigation_on=0.5)
    plant.cycle()
    plant.cycle(lamp_on=0.5, irrigation_on=0.25)
    plant.cycle()
    assert not plant.understood
    plant.cycle(lamp_on=0.25, irrigation_on=0.5)
    assert plant.understood
    assert plant.found == []


def test_a_hand_that_sets_what_a_silent_unit_showed_last_waits_for_it_no_longer_than_a_minute() -> None:
    plant = Watched(lamp_on=0.25, irrigation_on=0.5)
    plant.cycle()
    plant.shows["lamp_on"] = 0.5
    for _ in range(12):
        plant.now += 10.0
        plant.read("lamp_on")
    assert plant.hands() == {"lamp_on": 0.5}


def test_a_unit_that_shows_the_numbers_of_another_one_which_is_still_itself_is_not_that_one() -> None:
    """Its settings were copied."""
    plant = Watched(lamp_on=0.25, irrigation_on=0.5)
    plant.cycle()
    plant.cycle(lamp_on=0.5)
    plant.cycle(irrigation_on=0.75)
    plant.cycle()
    assert plant.hands() == {"lamp_on": 0.5, "irrigation_on": 0.75}
    assert plant.understood


def test_a_whole_unit_that_got_the_settings_of_another_one_is_read_as_it_stands() -> None:
    """Several numbers, outside the limits: certain, were the other one not still in its place."""

    async def played() -> None:
        bench = await controlled(two_buses=False)
        for name, value in {"heating_setpoint": 1.0, "co2_setpoint": 0.5}.items():
            bench.unit_of(name).set_value(name, value)
        await cycles(bench, 6)
        assert not alarms(bench)
        assert {name: bench.stands(name) for name in WISH} == WISH, "outside the limits nothing is left standing"
        await bench.close()

    run(played())
