"""A process that was stopped in the middle of a cycle, or its machine: what it does first when it goes on."""

import pytest

from igrow.edge.held import CLOCKS, LONGEST, Held
from tests.control.control_fakes import FixedSource
from tests.control.stubborn_plc import SAFE, make_stubborn_bench

WISH = {"heating_setpoint": 21.0, "co2_setpoint": 700.0, "lamp_on": 1.0, "irrigation_on": 0.5}


def bench_with_clocks(interval=0.0):
    bench, ahead = make_stubborn_bench(FixedSource(dict(WISH))), [0.0] * len(CLOCKS)

    def clock(number):
        return lambda: bench.clock.monotonic() + ahead[number]

    bench.cycle.held = Held(interval, [clock(number) for number in range(len(CLOCKS))])
    return bench, ahead


@pytest.mark.parametrize("clock", range(len(CLOCKS)))
@pytest.mark.parametrize("held_at", ["heating_setpoint", "read"])
async def test_what_was_decided_before_a_process_was_held_is_not_written_afterwards(clock, held_at):
    """Held by any clock: a stopped process, a sleeping machine, one whose hypervisor slept."""
    bench, ahead = bench_with_clocks()
    usual_write, usual_read, held = bench.plc.write, bench.plc.read, list[str]()

    def hold(name):
        if name == held_at and not held:
            held.append(name)
            ahead[clock] += 600.0
            if clock == 0:
                bench.clock.advance(600.0)
            bench.plc.by_hand("co2_setpoint", 555.0)

    async def write(name, value):
        await usual_write(name, value)
        hold(name)

    async def read(names=None):
        readings = await usual_read(names)
        hold("read")
        return readings

    bench.plc.write, bench.plc.read = write, read
    await bench.run(1)
    assert held
    assert bench.plc.values["co2_setpoint"] == 555.0
    assert bench.plc.written("co2_setpoint") == []
    assert bench.plc.written("heartbeat") == []
    await bench.run(3)
    assert bench.plc.values["co2_setpoint"] == 555.0
    assert [detail["point"] for detail in bench.events("changed_by_hand")] == ["co2_setpoint"]
    assert bench.plc.values["lamp_on"] == WISH["lamp_on"]
    assert len(bench.plc.written("heartbeat")) == 3


@pytest.mark.parametrize(("interval", "answer"), [(10.0, LONGEST / 10.0), (600.0, 50.0)])
async def test_a_slow_cycle_is_no_held_one(interval, answer):
    """Six writes of six seconds; or a serial line that a cycle of ten minutes keeps busy for nearly half of it."""
    bench, _ = bench_with_clocks(interval)
    usual = bench.plc.write

    async def write(name, value):
        bench.clock.advance(answer)
        await usual(name, value)

    bench.plc.write = write
    await bench.run(1)
    assert {name: bench.plc.values[name] for name in WISH} == WISH
    assert len(bench.plc.written("heartbeat")) == 1


async def test_what_a_plc_fell_back_to_while_the_gateway_slept_is_no_hand():
    """The clock that all ages are on runs on in the sleep, so the silence is seen."""
    bench = make_stubborn_bench(FixedSource(dict(WISH)))
    bench.plc.fallback_after = 60.0
    await bench.run(10)
    bench.clock.advance(6 * 3600.0)
    bench.plc.advance(6 * 3600.0)
    assert bench.plc.values["heating_setpoint"] == SAFE["heating_setpoint"]
    await bench.run(20)
    assert bench.events("changed_by_hand") == []
    assert {name: bench.plc.values[name] for name in WISH} == WISH
