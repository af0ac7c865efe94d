"""A PLC that answers what is read and refuses what is written, for minutes."""

from dataclasses import replace

from igrow.edge.bus.errors import refusal
from tests.control.control_fakes import FixedSource
from tests.control.stubborn_plc import RULES, make_stubborn_bench

BUSY = 6


async def test_a_ramp_that_is_refused_for_minutes_is_one_alarm():
    """Between two of its writes it wants none."""
    rules = {**RULES, "heating_setpoint": replace(RULES["heating_setpoint"], slew=2.0 / 3600.0, dead_band=0.02)}
    bench = make_stubborn_bench(FixedSource({"heating_setpoint": 21.0}), rules=rules)
    await bench.run(3)
    bench.plc.write_error = refusal("write", BUSY)
    before = len(bench.store.alarms)
    await bench.run(60)
    raised = [record for record in bench.store.alarms[before:] if record.name == "bus heating_setpoint"]
    assert [record.active for record in raised] == [True]
    bench.plc.write_error = None
    await bench.run(12)
    assert "bus heating_setpoint" not in bench.alarms
    assert bench.plc.written("heating_setpoint")
