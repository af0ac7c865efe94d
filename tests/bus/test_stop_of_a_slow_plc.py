"""The stop on a PLC that is slow, deaf or half gone: safe setpoints within ten seconds, or the truth about the rest."""

from __future__ import annotations

import asyncio

import pytest

from igrow.edge.guard import Write
from igrow.edge.stopping import STOP_SECONDS, StopReport, furthest_first
from igrow.edge.virtual_plc.memory import AnswerWithExceptionError
from tests.bus.fault_proxy import Fault
from tests.bus.plc_bench import INTERVAL, RULES, SAFE, PlcBench, make_plc_bench
from tests.bus.simulated_loop import run
from tests.bus.temperaments import MoodyUnit
from tests.control.control_fakes import FixedSource

WISHES = {"heating_setpoint": 21.0, "co2_setpoint": 700.0, "lamp_on": 1.0, "irrigation_on": 0.5}
PLANS = [FixedSource(WISHES)]


async def controlled(**more) -> PlcBench:
    """Return a bench whose setpoints are all off safe."""
    bench = await make_plc_bench(PLANS, **more)
    for _ in range(4):
        await bench.cycle.run()
        await asyncio.sleep(INTERVAL)
    assert {name: bench.stands(name) for name in RULES} == WISHES
    return bench


def standing(bench: PlcBench) -> dict[str, float | None]:
    return {name: bench.stands(name) for name in RULES}


@pytest.mark.parametrize("rtu", [False, True], ids=["tcp", "rtu"])
@pytest.mark.parametrize("into_the_cycle", [0.0, 0.1, 1.5, 3.0, 5.0, 7.0])
def test_a_plc_that_takes_1_2_s_an_answer_gets_every_safe_setpoint_in_time(rtu: bool, into_the_cycle: float) -> None:
    async def main() -> float:
        bench = await controlled(rtu=rtu, timeout=3.0)
        bench.proxies["first"].slow = 1.2
        cycle = asyncio.ensure_future(bench.cycle.run()) if into_the_cycle else None
        await asyncio.sleep(into_the_cycle)
        report, took = await bench.stop(cycle)
        assert standing(bench) == SAFE
        assert report.failed == {}
        assert report.words() == "the safe setpoints were written"
        return took

    assert run(main()) < STOP_SECONDS


def test_what_a_plc_is_too_slow_for_is_named_with_the_reason_and_the_rest_is_written() -> None:
    async def main() -> None:
        bench = await controlled(timeout=8.0)
        bench.proxies["first"].slow = 2.4
        report, took = await bench.stop()
        assert took <= STOP_SECONDS + 0.01
        assert set(report.written) | set(report.failed) == set(RULES)
        assert report.written
        assert all(bench.stands(name) == SAFE[name] for name in report.written)
        assert all("no answer within" in why for why in report.failed.values())
        assert all(name in report.words() for name in report.failed)

    run(main())


def test_a_line_that_is_dead_does_not_keep_the_other_from_its_safe_setpoints() -> None:
    async def main() -> None:
        bench = await controlled(two_buses=True, timeout=2.0)
        bench.proxies["first"].next_fault = lambda: Fault.NO_ANSWER
        cycle = asyncio.ensure_future(bench.cycle.run())
        await asyncio.sleep(0.5)
        report, took = await bench.stop(cycle)
        assert took <= STOP_SECONDS + 2.0
        # Its answers are lost, not its requests: what was not confirmed may be done, and is said to be open.
        assert set(report.failed) == {"heating_setpoint", "co2_setpoint"}
        assert report.written == {"lamp_on": 0.0, "irrigation_on": 0.125}
        assert standing(bench) == SAFE

    run(main())


def test_a_unit_that_rests_and_a_line_that_is_down_are_tried_once_more() -> None:
    async def main() -> None:
        bench = await controlled()
        bench.proxies["first"].next_fault = lambda: Fault.NO_REQUEST
        for _ in range(8):
            await bench.cycle.run()
            await asyncio.sleep(INTERVAL)
        del bench.proxies["first"].next_fault
        report, _ = await bench.stop()
        assert standing(bench) == SAFE
        assert report.failed == {}

    run(main())


def test_a_plc_that_is_gone_is_said_to_be_gone_and_soon() -> None:
    async def main() -> None:
        bench = await controlled()
        for server in bench.servers:
            await server.close()
        for proxy in bench.proxies.values():
            proxy.next_fault = lambda: Fault.HANG_UP
        report, took = await bench.stop()
        assert took < STOP_SECONDS
        assert set(report.failed) == set(RULES)
        assert report.words().startswith("nothing was written")
        assert all(name in report.words() for name in RULES)

    run(main())


def test_a_plc_that_was_never_heard_is_written_nothing() -> None:
    async def main() -> None:
        bench = await make_plc_bench(PLANS)
        bench.proxies["first"].next_fault = lambda: Fault.NO_REQUEST
        await bench.cycle.run()
        report, _ = await bench.stop()
        assert not report.seen
        assert report.words() == "the PLC does not answer, so its own safe setpoints rule after its timeout"
        assert not any(bench.received(name) for name in RULES)

    run(main())


def test_a_register_that_refuses_is_named_and_not_asked_again() -> None:
    async def main() -> None:
        bench = await controlled()
        tries = []

        def refusing(function, address, values):
            tries.append(address)
            raise AnswerWithExceptionError(4)

        bench.units["other"].write = refusing
        report, _ = await bench.stop()
        assert tries == [0, 2]
        assert set(report.failed) == {"lamp_on", "irrigation_on"}
        assert "device failure" in report.failed["lamp_on"]
        assert {name: bench.stands(name) for name in report.written} == {
            "heating_setpoint": 18.0,
            "co2_setpoint": 400.0,
        }

    run(main())


def test_what_is_known_to_stand_elsewhere_goes_before_what_is_unknown_and_what_stands_there_already() -> None:
    def write(name: str) -> Write:
        return Write(name, SAFE[name], SAFE[name], "stop", "", urgent=True)

    shown = {"heating_setpoint": None, "co2_setpoint": 400.0, "lamp_on": 1.0, "irrigation_on": None}
    order = [write.point for write in furthest_first([write(name) for name in RULES], shown)]
    assert order == ["lamp_on", "heating_setpoint", "irrigation_on", "co2_setpoint"]


def test_a_hand_that_has_moved_a_setpoint_since_the_last_cycle_keeps_it() -> None:
    async def main() -> None:
        bench = await controlled(respect_hand=7200.0)
        bench.units["plc"].set_value("heating_setpoint", 23.0)
        report, _ = await bench.stop()
        assert standing(bench) == SAFE | {"heating_setpoint": 23.0}
        assert report.by_hand == ("heating_setpoint",)
        assert "heating_setpoint, which a hand has set" in report.words()

    run(main())


def test_the_ledger_holds_what_the_stop_wrote_and_what_it_could_not() -> None:
    async def main() -> None:
        bench = await controlled(two_buses=True, timeout=2.0)
        bench.proxies["first"].next_fault = lambda: Fault.NO_ANSWER
        before = len(bench.store.writes)
        await bench.stop()
        rows = {row.point: row for row in bench.store.writes[before:] if row.source == "stop"}
        assert {name: row.outcome for name, row in rows.items()} == dict.fromkeys(RULES, "written")
        assert "no answer within" in rows["heating_setpoint"].reason
        assert rows["lamp_on"].reason == ""

    run(main())


def moody(**temper: object) -> tuple[StopReport, float, dict[str, float | None]]:
    async def main() -> tuple[StopReport, float, dict[str, float | None]]:
        bench = await controlled(unit=MoodyUnit)
        unit = bench.units["plc"]
        for name, value in temper.items():
            setattr(unit, name, value)
        if "deaf_for" in temper:
            await bench.plc.write("heating_setpoint", 20.0)
        report, took = await bench.stop()
        return report, took, standing(bench)

    return run(main())


def test_a_plc_that_takes_what_is_written_later_is_said_to() -> None:
    report, took, _ = moody(takes_at=3600.0)
    assert report.unshown == {"heating_setpoint": 21.0, "co2_setpoint": 700.0}
    assert "heating_setpoint was taken, but the PLC still shows 21 degC" in report.words()
    assert took < STOP_SECONDS


def test_a_plc_on_its_way_to_the_safe_setpoint_is_said_to_be() -> None:
    report, _, _ = moody(ramps={"heating_setpoint": 0.1})
    assert set(report.unshown) == {"heating_setpoint"}


def test_a_write_that_a_plc_has_confirmed_and_lost_is_sent_once_more() -> None:
    report, _, stands = moody(deaf_for={"heating_setpoint": 1.0})
    assert stands == SAFE
    assert report.unshown == {}
