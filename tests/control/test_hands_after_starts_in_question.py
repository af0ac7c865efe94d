"""A PLC has started anew, too little was read to say so, and somebody sets a value by hand before it is known."""

import pytest

from igrow.edge.guard.heartbeat import HEARTBEAT
from tests.control.control_fakes import FixedSource
from tests.control.stubborn_plc import SAFE, StubbornBench, make_stubborn_bench
from tests.control.test_starts_seen_by_halves import INSIDE, OUTSIDE, WISH, lose

ZEROS = dict.fromkeys(WISH, 0.0)


def bench_of(**more) -> StubbornBench:
    return make_stubborn_bench(FixedSource(dict(WISH)), **more)


def hands(bench: StubbornBench) -> list[tuple[str, float]]:
    return [(event["point"], event["shown"]) for event in bench.events("changed_by_hand")]


@pytest.mark.parametrize("defaults", [OUTSIDE, ZEROS])
@pytest.mark.parametrize("clears", [True, False])
async def test_a_hand_after_a_start_that_was_seen_but_not_judged_is_the_only_hand(defaults, clears):
    bench = bench_of()
    await bench.run(5)
    end = lose(bench, HEARTBEAT)
    bench.plc.power_up(defaults, heartbeat=clears)
    await bench.run(1)
    bench.plc.by_hand("heating_setpoint", 16.0)
    await bench.run(2)
    end()
    await bench.run(3)
    assert hands(bench) == [("heating_setpoint", 16.0)]
    assert {event["point"] for event in bench.events("plc_restarted")} == WISH.keys()
    assert {name: bench.plc.values[name] for name in WISH} == WISH | {"heating_setpoint": 16.0}


async def test_it_is_so_where_the_hand_and_the_cleared_heartbeat_are_seen_together():
    """No limit tells these defaults from a hand; but a start after the hand would have moved the others again."""
    bench = bench_of()
    await bench.run(5)
    end = lose(bench, HEARTBEAT)
    bench.plc.ignores.add(HEARTBEAT)
    bench.plc.power_up(INSIDE)
    await bench.run(2)
    end()
    bench.plc.by_hand("co2_setpoint", 550.0)
    await bench.run(1)
    bench.plc.ignores.clear()
    await bench.run(2)
    assert hands(bench) == [("co2_setpoint", 550.0)]
    assert {name: bench.plc.values[name] for name in WISH} == WISH | {"co2_setpoint": 550.0}


async def test_a_start_after_a_hand_that_was_not_judged_yet_is_no_hand():
    bench = bench_of()
    await bench.run(5)
    end = lose(bench, HEARTBEAT)
    bench.plc.by_hand("co2_setpoint", 550.0)
    await bench.run(2)
    end()
    bench.plc.power_up(INSIDE)
    await bench.run(3)
    assert set(hands(bench)) <= {("co2_setpoint", 550.0)}
    assert {name: bench.plc.values[name] for name in WISH if name != "co2_setpoint"} == {
        name: wish for name, wish in WISH.items() if name != "co2_setpoint"
    }


async def test_a_hand_that_changes_its_mind_before_it_is_known_is_one_hand():
    bench = bench_of()
    await bench.run(5)
    end = lose(bench, HEARTBEAT)
    for value in (15.0, 16.0):
        bench.plc.by_hand("heating_setpoint", value)
        await bench.run(1)
    end()
    await bench.run(3)
    assert hands(bench) == [("heating_setpoint", 16.0)]


@pytest.mark.parametrize("setpoint", ["heating_setpoint", "co2_setpoint"])
async def test_a_heartbeat_that_is_seen_to_be_cleared_later_belongs_to_the_start_that_the_setpoints_told(setpoint):
    bench = bench_of()
    await bench.run(5)
    end = lose(bench, HEARTBEAT)
    bench.plc.ignores.add(HEARTBEAT)
    bench.plc.power_up(OUTSIDE)
    await bench.run(9)
    assert {event["point"] for event in bench.events("plc_restarted")} == WISH.keys()
    end()
    bench.plc.by_hand(setpoint, INSIDE[setpoint])
    await bench.run(1)
    bench.plc.ignores.clear()
    await bench.run(2)
    assert hands(bench) == [(setpoint, INSIDE[setpoint])]
    assert bench.plc.values[setpoint] == INSIDE[setpoint]


async def test_a_stop_judges_a_start_by_all_that_was_seen_of_it():
    """One setpoint was looked at with the start and still waits for our write: it is not read again by the stop."""
    bench = bench_of(values={"co2_setpoint": 360.0})
    bench.plc.ignores.add("co2_setpoint")
    await bench.run(2)
    lose(bench, HEARTBEAT)
    bench.plc.power_up({"heating_setpoint": 10.5, "lamp_on": 0.0, "irrigation_on": 0.0})
    await bench.run(1)
    lose(bench, *WISH, HEARTBEAT)
    await bench.cycle.stop()
    assert not hands(bench)
    assert bench.plc.values["heating_setpoint"] == 18.0


async def test_a_reload_does_not_forget_what_was_seen_of_a_start():
    bench = bench_of()
    await bench.run(5)
    end = lose(bench, HEARTBEAT)
    bench.plc.power_up(OUTSIDE)
    await bench.run(1)
    before, bench.cycle = bench.cycle, bench.build()
    bench.cycle.carry_over(before, [*WISH, HEARTBEAT])
    bench.plc.by_hand("heating_setpoint", 16.0)
    await bench.run(2)
    end()
    await bench.run(3)
    assert hands(bench) == [("heating_setpoint", 16.0)]
    assert {name: bench.plc.values[name] for name in WISH} == WISH | {"heating_setpoint": 16.0}


@pytest.mark.parametrize("happens", ["fallback", "start"])
async def test_a_restart_does_not_forget_what_a_plc_has_shown_and_nobody_has_judged_yet(happens):
    """Its sign is gone with our next heartbeat, so the next process cannot see it."""
    bench = bench_of(values={"plc_fallback": 0.0})
    await bench.run(5)
    end = lose(bench, *WISH)
    if happens == "fallback":
        bench.plc.values |= {**SAFE, "plc_fallback": 1.0}
    else:
        bench.plc.power_up(INSIDE)
    await bench.run(1)
    bench.plc.values["plc_fallback"] = 0.0
    end()
    bench.pass_time(5.0)
    bench.restart()
    await bench.run(4)
    assert not hands(bench)
    assert {name: bench.plc.values[name] for name in WISH} == WISH
