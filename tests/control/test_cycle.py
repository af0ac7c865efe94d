"""The control cycle on a fake PLC: order, confirmation, hands, faults."""

import ast
from dataclasses import replace
from pathlib import Path

import pytest

from igrow.edge.bus.errors import NoAnswerError, UnitRestingError
from igrow.edge.guard import Bound, Interlock
from tests.control.control_fakes import CO2, HEATING, FixedSource, make_bench

FAST = {"heating_setpoint": replace(HEATING, slew=None, minimum_interval=0.0), "co2_setpoint": CO2}


async def test_setpoints_are_written_and_the_heartbeat_goes_last():
    bench = make_bench(source=FixedSource({"heating_setpoint": 21.0, "co2_setpoint": 700.0}), rules=FAST)
    await bench.run()
    assert [name for _, name, _ in bench.plc.writes] == ["heating_setpoint", "co2_setpoint", "heartbeat"]
    assert bench.result.decision.source == "plan"


async def test_the_heartbeat_changes_in_every_cycle():
    bench = make_bench()
    await bench.run(5)
    assert bench.plc.written("heartbeat") == [1.0, 2.0, 3.0, 4.0, 5.0]


async def test_a_write_counts_when_a_later_read_shows_it():
    bench = make_bench(source=FixedSource({"heating_setpoint": 21.0}), rules=FAST)
    await bench.run()
    assert [record.outcome for record in bench.store.writes] == ["written"]
    await bench.run()
    assert [record.outcome for record in bench.store.writes] == ["written", "confirmed"]
    assert bench.plc.written("heating_setpoint") == [21.0]


async def test_a_write_that_the_plc_does_not_take_raises_an_alarm_and_is_tried_again():
    bench = make_bench(source=FixedSource({"heating_setpoint": 21.0}), rules=FAST)
    bench.plc.ignores = {"heating_setpoint"}
    await bench.run(9)
    (alarm,) = bench.journal.alarms.active
    assert alarm.text == "21 degC was written to heating_setpoint, but the PLC shows 18 degC"
    assert len(bench.plc.written("heating_setpoint")) == 2
    bench.plc.ignores = set()
    bench.plc.values["heating_setpoint"] = 21.0
    await bench.run(2)
    assert not bench.journal.alarms.active


async def test_a_change_by_hand_is_noticed_respected_and_ends():
    bench = make_bench(source=FixedSource({"heating_setpoint": 21.0}), rules=FAST, respect_hand=600.0)
    await bench.run(3)
    bench.plc.values["heating_setpoint"] = 16.0
    await bench.run(59)
    assert bench.plc.values["heating_setpoint"] == 16.0
    assert bench.result.setpoints["heating_setpoint"].held_until is not None
    assert "changed_by_hand" in bench.store.kinds()
    await bench.run(3)
    assert bench.plc.values["heating_setpoint"] == 21.0
    assert "hand_no_longer_respected" in bench.store.kinds()


async def test_after_a_hand_the_ramp_begins_where_the_plc_stands():
    rules = FAST | {"heating_setpoint": replace(HEATING, dead_band=0.0, minimum_interval=0.0)}
    bench = make_bench(source=FixedSource({"heating_setpoint": 18.0}), rules=rules, respect_hand=60.0)
    await bench.run(3)
    bench.plc.values["heating_setpoint"] = 26.0
    await bench.run(10)
    first = bench.plc.written("heating_setpoint")[0]
    assert first == pytest.approx(26.0 - 10.0 * 4.0 / 3600.0)


async def test_the_plcs_own_fallback_is_not_taken_for_a_hand():
    bench = make_bench(source=FixedSource({"heating_setpoint": 21.0}), rules=FAST, values={"plc_fallback": 0.0})
    await bench.run(3)
    bench.plc.values |= {"heating_setpoint": 17.0, "plc_fallback": 1.0}
    await bench.run()
    assert "plc_fell_back" in bench.store.kinds()
    assert "changed_by_hand" not in bench.store.kinds()
    assert bench.plc.values["heating_setpoint"] == 21.0


async def test_safe_setpoints_found_after_a_silence_are_a_fallback():
    bench = make_bench(source=FixedSource({"heating_setpoint": 21.0}), rules=FAST)
    await bench.run(3)
    bench.plc.silent = True
    await bench.run(3)
    bench.plc.silent = False
    bench.plc.values["heating_setpoint"] = 18.0
    await bench.run()
    assert "plc_fell_back" in bench.store.kinds()
    assert bench.plc.values["heating_setpoint"] == 21.0


async def test_a_hand_that_was_there_during_a_silence_is_still_respected():
    bench = make_bench(source=FixedSource({"heating_setpoint": 21.0}), rules=FAST)
    await bench.run(3)
    bench.plc.silent = True
    await bench.run(3)
    bench.plc.silent = False
    bench.plc.values["heating_setpoint"] = 15.0
    await bench.run(3)
    assert "changed_by_hand" in bench.store.kinds()
    assert bench.plc.values["heating_setpoint"] == 15.0


async def test_a_plc_under_manual_operation_is_left_alone():
    bench = make_bench(
        source=FixedSource({"heating_setpoint": 21.0}), rules=FAST, values={"plc_manual": 1.0}, respect_hand=600.0
    )
    await bench.run(3)
    assert bench.plc.written("heating_setpoint") == []
    bench.plc.values["plc_manual"] = 0.0
    await bench.run()
    assert bench.plc.written("heating_setpoint") == [21.0]


async def test_a_dead_line_raises_one_alarm_writes_nothing_and_stops_no_cycle():
    bench = make_bench(source=FixedSource({"heating_setpoint": 21.0}), rules=FAST)
    bench.plc.silent = True
    await bench.run(100)
    assert bench.plc.writes == []
    assert [alarm.name for alarm in bench.store.alarms] == ["link"]
    bench.plc.silent = False
    await bench.run()
    assert not bench.journal.alarms.active
    assert bench.plc.values["heating_setpoint"] == 21.0


async def test_no_ramp_runs_on_while_the_line_is_dead():
    bench = make_bench(source=FixedSource({"heating_setpoint": 26.0}))
    await bench.run(3)
    bench.plc.silent = True
    await bench.run(720)
    bench.plc.silent = False
    await bench.run(2)
    assert bench.plc.values["heating_setpoint"] <= 18.3


async def test_a_write_that_was_certainly_not_sent_costs_no_budget():
    rules = {"heating_setpoint": replace(HEATING, slew=None, minimum_interval=0.0, daily_budget=3)}
    bench = make_bench(source=FixedSource({"heating_setpoint": 21.0}), rules=rules)
    bench.plc.write_error = UnitRestingError("rests")
    await bench.run(20)
    bench.plc.write_error = None
    await bench.run(2)
    assert bench.plc.values["heating_setpoint"] == 21.0


async def test_a_write_that_may_have_arrived_costs_budget():
    rules = {"heating_setpoint": replace(HEATING, slew=None, minimum_interval=0.0, daily_budget=3)}
    bench = make_bench(source=FixedSource({"heating_setpoint": 21.0}), rules=rules)
    bench.plc.write_error = NoAnswerError("silence")
    await bench.run(60)
    bench.plc.write_error = None
    await bench.run(20)
    assert bench.plc.values["heating_setpoint"] == 18.0
    assert any(record.outcome == "clamped" and "are used" in record.reason for record in bench.store.writes)


async def test_a_standing_clamp_leaves_one_row_not_one_per_cycle():
    bench = make_bench(source=FixedSource({"heating_setpoint": 99.0}), rules=FAST)
    await bench.run(50)
    rows = [record for record in bench.store.writes if record.outcome == "clamped"]
    assert len(rows) == 1
    assert (rows[0].requested, rows[0].applied) == (99.0, 28.0)


async def test_stopping_writes_the_safe_setpoints():
    bench = make_bench(source=FixedSource({"heating_setpoint": 25.0, "co2_setpoint": 900.0}), rules=FAST)
    await bench.run(3)
    await bench.cycle.stop()
    assert bench.plc.values["heating_setpoint"] == 18.0
    assert bench.plc.values["co2_setpoint"] == 400.0


async def test_stopping_without_a_line_ends_too():
    bench = make_bench(source=FixedSource({"heating_setpoint": 25.0}), rules=FAST)
    await bench.run(3)
    bench.plc.silent = True
    await bench.cycle.stop()


async def test_telemetry_waits_for_a_trusted_clock_and_is_dated_back():
    bench = make_bench()
    bench.clock.wall = None
    await bench.run(6)
    assert bench.store.rows == []
    bench.clock.wall = 1_700_000_000.0
    await bench.run()
    times = [time for time, _ in bench.store.rows]
    assert times == [1_700_000_010.0 - 10.0 * back for back in (6, 5, 4, 3, 2, 1, 0)]


async def test_a_clock_of_1970_stops_nothing():
    bench = make_bench(source=FixedSource({"heating_setpoint": 21.0}), rules=FAST)
    bench.clock.wall = None
    await bench.run(3)
    assert bench.plc.values["heating_setpoint"] == 21.0
    assert bench.plc.written("heartbeat") == [1.0, 2.0, 3.0]


async def test_a_bad_sensor_raises_an_alarm_that_names_it():
    bench = make_bench(values={"air_temperature": 1e9})
    await bench.run()
    assert [alarm.text for alarm in bench.journal.alarms.active] == [
        "air_temperature is out_of_range: 1e+09 degC is outside -1e+06 degC to 1e+06 degC"
    ]


async def test_wind_comes_before_a_hand_and_before_other_writes():
    wind = Interlock("wind", "wind_speed", {"co2_setpoint": Bound(high=500.0)}, above=15.0, release=10.0)
    bench = make_bench(
        source=FixedSource({"heating_setpoint": 21.0, "co2_setpoint": 900.0}), rules=FAST, interlocks=(wind,),
        values={"wind_speed": 2.0},
    )  # fmt: skip
    await bench.run(3)
    bench.plc.values["co2_setpoint"] = 990.0
    await bench.run(2)
    assert bench.plc.values["co2_setpoint"] == 990.0
    bench.plc.values["wind_speed"] = 20.0
    await bench.run()
    assert bench.plc.values["co2_setpoint"] == 500.0


def test_only_the_guards_writer_writes_to_a_plc():
    """Reads the sources: `write` of anything called plc, or of a RegisterPlc, is called in one file."""
    root = Path(__file__).resolve().parents[2] / "edge"
    callers = set()
    for path in root.rglob("*.py"):
        if "bus" in path.parts or "virtual_plc" in path.parts:
            continue
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)):
                continue
            if node.func.attr == "write" and "plc" in ast.unparse(node.func.value).lower():
                callers.add(path.relative_to(root).as_posix())
    assert callers == {"guard/writer.py"}
