"""Faults over real sockets: the daemon against the virtual PLC."""

from __future__ import annotations

import asyncio
import signal
import sys
from pathlib import Path
from typing import Any

import pytest

from igrow.core.site import Site
from igrow.edge.daemon import Daemon
from igrow.edge.image import Quality
from igrow.edge.planning import GraphProcess, PlanningProcess
from igrow.edge.store import read_records, read_telemetry
from igrow.edge.virtual_plc.pace import Realtime
from tests.control.daemon_bench import (
    MAP,
    Plant,
    control_of,
    free_port,
    last,
    plan_at_once,
    running,
    until,
    write_files,
)
from tests.patience import PATIENCE


def kinds(folder: Path) -> list[str]:
    return [str(record.body["kind"]) for record in read_records(folder / "state" / "store", "event")]


def agreed(daemon: Daemon, name: str) -> float | None:
    """What the daemon has last seen in the PLC."""
    return None if daemon._control is None else daemon._control.cycle.readback.points[name].stands


async def test_the_daemon_controls_in_lockstep_and_leaves_safe_setpoints(tmp_path):
    port = free_port()
    path = write_files(tmp_path, port)
    plant = Plant(tmp_path, port)
    await plant.up()
    async with running(path) as daemon:
        await until(lambda: daemon.cycles >= 50)
        assert plant.shows("heating_setpoint") == 19.0
        assert plant.shows("co2_setpoint") == 700.0
        assert plant.table.setpoints["heating_setpoint"] == 19.0
    assert plant.shows("heating_setpoint") == 18.0
    assert plant.shows("co2_setpoint") == 400.0
    await plant.down()
    log = read_telemetry(tmp_path / "state" / "store", 0.0, 8e9)
    assert len(log) >= 50
    assert {"started", "source", "stopped"} <= set(kinds(tmp_path))


async def test_a_server_that_is_down_at_boot_is_found_when_it_comes(tmp_path):
    port = free_port()
    path = write_files(tmp_path, port)
    async with running(path) as daemon:
        await until(lambda: daemon.cycles >= 1)
        assert not last(daemon).image.link_ok
        plant = Plant(tmp_path, port)
        await plant.up()
        await until(lambda: plant.shows("heating_setpoint") == 19.0)
    await plant.down()


async def test_a_line_that_is_lost_and_comes_back_is_used_again(tmp_path):
    port = free_port()
    path = write_files(tmp_path, port)
    plant = Plant(tmp_path, port)
    await plant.up()
    async with running(path) as daemon:
        await until(lambda: daemon.cycles >= 20)
        plant.plc.drop_connections()
        cycles = daemon.cycles
        await until(lambda: daemon.cycles > cycles + 20 and last(daemon).image.link_ok)
        await plant.down()
        await until(lambda: [alarm.name for alarm in daemon._journal.alarms.active] == ["link"])
        await plant.up()
        await until(lambda: last(daemon).image.link_ok and plant.shows("heating_setpoint") == 19.0)
        assert not daemon._journal.alarms.active
    await plant.down()
    assert "changed_by_hand" not in kinds(tmp_path)


async def test_a_frozen_thermometer_moves_heating_to_the_safe_setpoint(tmp_path):
    port = free_port()
    path = write_files(tmp_path, port)
    plant = Plant(tmp_path, port)
    await plant.up()
    async with running(path) as daemon:
        await until(lambda: plant.shows("heating_setpoint") == 19.0)
        plant.table.frozen.add("air_temperature")
        await until(lambda: plant.shows("heating_setpoint") == 18.0)
        await until(lambda: last(daemon).image.value_of("air_temperature").quality is Quality.FROZEN)
        plant.table.frozen.clear()
        await until(lambda: plant.shows("heating_setpoint") == 19.0)
    await plant.down()


async def test_a_plc_in_1970_is_controlled_by_light_and_nothing_is_dated(tmp_path):
    port = free_port()
    path = write_files(tmp_path, port)
    plant = Plant(tmp_path, port, start="1970-01-01T01:00:00")
    await plant.up()
    async with running(path) as daemon:
        await until(lambda: daemon.cycles >= 30)
        assert last(daemon).image.true_time is None
        assert "told by the light" in last(daemon).decision.why
        assert plant.shows("heating_setpoint") == 19.0
    await plant.down()
    assert not (tmp_path / "state" / "store" / "telemetry.db").exists()
    assert all(record.time is None for record in read_records(tmp_path / "state" / "store", "event"))


async def test_a_setpoint_changed_at_the_plc_is_respected_also_across_kill_9_and_a_restart(tmp_path):
    port = free_port()
    path = write_files(tmp_path, port, clock="system", interval="1 s")
    plant = Plant(tmp_path, port, pace=Realtime())
    await plant.up()
    command = [sys.executable, "-m", "igrow.edge.cli", "run", str(path)]
    process = await asyncio.create_subprocess_exec(*command)

    async def another_beat():
        beat = plant.shows("heartbeat")
        await until(lambda: plant.shows("heartbeat") not in (beat, 0.0))

    async def two_cycles():
        """The second change of the heartbeat comes after a whole cycle."""
        await another_beat()
        await another_beat()

    try:
        await until(lambda: plant.shows("co2_setpoint") > 400.0)
        await two_cycles()
        plant.plc.set_by_hand("co2_setpoint", 555.0)
        await until(lambda: "changed_by_hand" in kinds(tmp_path))
        process.send_signal(signal.SIGKILL)
        await process.wait()
        process = await asyncio.create_subprocess_exec(*command)
        await two_cycles()
        assert plant.shows("co2_setpoint") == 555.0
        process.send_signal(signal.SIGTERM)
        assert await asyncio.wait_for(process.wait(), PATIENCE) == 0
        assert (plant.shows("heating_setpoint"), plant.shows("co2_setpoint")) == (18.0, 555.0)
        process = await asyncio.create_subprocess_exec(*command)
        await two_cycles()
        assert plant.shows("co2_setpoint") == 555.0
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
    await plant.down()
    stops = [
        r.body["detail"] for r in read_records(tmp_path / "state" / "store", "event") if r.body["kind"] == "stopped"
    ]
    assert stops == [{"setpoints": "the safe setpoints were written, but for co2_setpoint, which a hand has set"}]
    (newest, *_) = read_records(tmp_path / "state" / "store", "state")
    points: Any = newest.body["points"]
    assert points["co2_setpoint"]["hand"] == 555.0


async def test_a_hand_that_has_been_respected_for_long_enough_does_not_begin_again_with_a_restart(tmp_path):
    port = free_port()
    path = write_files(tmp_path, port, respect_hand="20 min")
    plant = Plant(tmp_path, port)
    await plant.up()
    async with running(path) as daemon:
        await until(lambda: agreed(daemon, "co2_setpoint") == 700.0)
        plant.plc.set_by_hand("co2_setpoint", 555.0)
        await until(lambda: "changed_by_hand" in kinds(tmp_path))
    async with running(path) as daemon:
        await until(lambda: plant.shows("co2_setpoint") == 700.0)
        cycles = daemon.cycles
        await until(lambda: daemon.cycles >= cycles + 10)
        assert plant.shows("co2_setpoint") == 700.0
    await plant.down()
    assert kinds(tmp_path).count("changed_by_hand") == 1


POLLED = MAP.replace("unit: degC}}", "unit: degC, poll: 1 h}}").replace("unit: m s-1}}", "unit: m s-1, poll: 1 h}}")


async def test_a_reload_keeps_what_is_known_of_sensors_that_are_seldom_read(tmp_path):
    port = free_port()
    path = write_files(tmp_path, port, clock="system", interval="1 s", map_text=POLLED)
    plant = Plant(tmp_path, port, pace=Realtime())
    await plant.up()
    async with running(path) as daemon:
        await until(lambda: daemon.cycles >= 3)
        before = last(daemon).image.value_of("air_temperature")
        control = daemon._control
        daemon.reload()
        await until(lambda: daemon._control is not control and last(daemon).image.monotonic > 0)
        cycles = daemon.cycles
        await until(lambda: daemon.cycles >= cycles + 2)
        value = last(daemon).image.value_of("air_temperature")
        assert (value.value, value.quality) == (before.value, Quality.GOOD)
        assert value.age > before.age
        assert not daemon._journal.alarms.active
    await plant.down()
    written = [row.body for row in read_records(tmp_path / "state" / "store", "write")]
    assert not [row for row in written if row["source"] == "interlock"]


async def test_a_reload_looks_afresh_at_a_point_that_means_another_register_now(tmp_path):
    port = free_port()
    path = write_files(tmp_path, port)
    plant = Plant(tmp_path, port)
    await plant.up()
    async with running(path) as daemon:
        await until(lambda: plant.shows("heating_setpoint") == 19.0 and plant.shows("co2_setpoint") == 700.0)
        control = daemon._control
        # Now scaled: the very same register means another temperature.
        old = "address: 0, type: float32, unit: degC, writable: true"
        text = (tmp_path / "map.yaml").read_text()
        assert old in text
        (tmp_path / "map.yaml").write_text(text.replace(old, old.replace("unit", "scale: 2, unit")))
        daemon.reload()
        await until(lambda: daemon._control is not control)
        cycles = daemon.cycles
        await until(lambda: daemon.cycles >= cycles + 10)
    await plant.down()
    assert "changed_by_hand" not in kinds(tmp_path)


async def test_an_int16_heartbeat_goes_on_past_its_highest_number(tmp_path):
    port = free_port()
    lines = MAP.replace('address: 3, type: uint16, unit: "1"', 'address: 3, type: int16, high: 32767, unit: "1"')
    path = write_files(tmp_path, port, map_text=lines)
    plant = Plant(tmp_path, port)
    await plant.up()
    plant.plc.memory.set_value("heartbeat", 32760.0)
    seen = []
    write = plant.plc.write

    def watched(function, address, values):
        write(function, address, values)
        if address == 3:
            seen.append(plant.shows("heartbeat"))

    plant.plc.write = watched
    async with running(path) as daemon:
        await until(lambda: daemon.cycles >= 20)
        assert not daemon._journal.alarms.active
    await plant.down()
    assert seen[:10] == [32761.0, 32762.0, 32763.0, 32764.0, 32765.0, 32766.0, 32767.0, 1.0, 2.0, 3.0]


TWO_BUSES = MAP.replace(
    "timeout: 0.5 s}}", "timeout: 0.5 s}}\n  other: {{transport: tcp, host: 127.0.0.1, port: {other}, timeout: 0.5 s}}"
).replace("device_id: 1}}", "device_id: 1}}\n  second: {{bus: other, device_id: 1}}")
TWO_BUSES = TWO_BUSES.replace("co2_setpoint: {{device: plc", "co2_setpoint: {{device: second")
TWO_BUSES = "\n".join(line for line in TWO_BUSES.splitlines() if "plc_fallback" not in line)


async def test_a_bus_that_is_down_while_another_one_is_up_falls_back_and_that_is_no_hand(tmp_path):
    port, other = free_port(), free_port()
    path = write_files(tmp_path, port, clock="plc", map_text=TWO_BUSES.replace("{other}", str(other)))
    first = Plant(tmp_path, port, pace=Realtime(300.0))
    await first.up()
    second = Plant(tmp_path, other, pace=Realtime(300.0), device="second")
    await second.up()
    async with running(path) as daemon:
        await until(lambda: agreed(daemon, "co2_setpoint") == 700.0)
        await second.down()
        await until(lambda: [alarm.name for alarm in daemon._journal.alarms.active] == ["link second"])
        assert last(daemon).image.link_ok
        cycles = daemon.cycles
        await until(lambda: daemon.cycles >= cycles + 4)
        await second.up()
        assert second.shows("co2_setpoint") == 400.0
        await until(lambda: second.shows("co2_setpoint") == 700.0)
    await first.down()
    await second.down()
    assert "changed_by_hand" not in kinds(tmp_path)
    assert "plc_fell_back" in kinds(tmp_path)


async def test_a_planner_that_hangs_delays_no_cycle_and_the_recipe_rules(tmp_path, monkeypatch):
    port = free_port()
    path = write_files(tmp_path, port, clock="system", interval="1 s")
    plant = Plant(tmp_path, port, pace=Realtime())
    await plant.up()
    async with running(path) as daemon:
        await until(lambda: daemon.cycles >= 2)
        assert daemon.services.planning is not None
        daemon.services.planning.close()
        planner = PlanningProcess(
            daemon.configuration.site, GraphProcess(), seconds=3.0, planner="tests.control.hanging_planner:make_plan"
        )
        # A day of log is asked for before a first plan; this test has no day.
        monkeypatch.setattr("igrow.edge.planning_schedule.LEAST_HISTORY", 0.0)
        await plan_at_once(daemon, planner, tmp_path)
        await until(lambda: planner.busy)
        cycles = daemon.cycles
        await until(lambda: daemon.cycles >= cycles + 3)
        assert last(daemon).decision.source == "recipe"
        await until(lambda: not planner.busy)
        assert "too long" in planner.health
        cycles = daemon.cycles
        await until(lambda: daemon.cycles > cycles)
    await plant.down()


async def test_a_reload_takes_a_good_configuration_and_keeps_the_last_good_one(tmp_path):
    port = free_port()
    path = write_files(tmp_path, port)
    plant = Plant(tmp_path, port)
    await plant.up()
    async with running(path) as daemon:
        await until(lambda: plant.shows("heating_setpoint") == 19.0)
        write_files(tmp_path, port, heating=20.0)
        daemon.reload()
        await until(lambda: plant.shows("heating_setpoint") == 20.0)
        path.write_text(path.read_text().replace("value: 20.0", "value: 99"))
        daemon.reload()
        await until(lambda: "reload_refused" in kinds(tmp_path))
        cycles = daemon.cycles
        await until(lambda: daemon.cycles > cycles + 10)
        assert plant.shows("heating_setpoint") == 20.0
        assert "99: 5 to 35 degC" in daemon._configuration_problem
        assert "changed_by_hand" not in kinds(tmp_path)
    await plant.down()


class SlowPlanner:
    """Makes a plan for as long as it is told to."""

    health = ""

    def __init__(self, site: Site) -> None:
        self.site = site
        self.asked: list[Site] = []
        self.busy = False

    def request(self, prepare) -> None:
        self.asked.append(self.site)
        self.busy = True

    def latest(self) -> None:
        return None

    async def wait(self, timeout: float) -> None:  # noqa: ASYNC109 - as the real one's
        return None

    def close(self) -> None:
        self.busy = False


async def test_a_reload_while_a_plan_is_made_holds_nothing_up_and_the_next_plan_is_for_the_new_site(tmp_path):
    port = free_port()
    path = write_files(tmp_path, port, clock="system", interval="1 s")
    plant = Plant(tmp_path, port, pace=Realtime())
    await plant.up()
    async with running(path) as daemon:
        await until(lambda: daemon.cycles >= 2)
        planner = SlowPlanner(daemon.configuration.site)
        await plan_at_once(daemon, planner, tmp_path)
        await until(lambda: planner.busy)
        site = tmp_path / "site.yaml"
        site.write_text(site.read_text().replace("high: 1000", "high: 900"))
        daemon.reload()
        await until(lambda: "reloaded" in kinds(tmp_path))
        cycles = daemon.cycles
        await until(lambda: daemon.cycles > cycles + 2)
        assert len(planner.asked) == 1
        assert planner.busy
        planner.busy = False
        await until(lambda: len(planner.asked) > 1)
        assert [site.limits["co2_setpoint"].high for site in planner.asked[:2]] == [1000.0, 900.0]
    await plant.down()


async def test_a_plant_that_runs_faster_than_time_is_followed_at_the_cycles_interval(tmp_path):
    port = free_port()
    path = write_files(tmp_path, port, clock="plc")
    plant = Plant(tmp_path, port, pace=Realtime(1500.0))
    await plant.up()
    async with running(path) as daemon:
        await until(lambda: daemon.cycles >= 8)
        assert last(daemon).image.link_ok
        spent = last(daemon).image.monotonic
        assert spent / (daemon.cycles - 1) >= 300.0
    await plant.down()
    times = read_telemetry(tmp_path / "state" / "store", 0.0, 8e9).time
    assert all(step >= 300 for step in (times[1:] - times[:-1]).astype(int))


async def test_a_reload_of_the_same_registers_keeps_the_line(tmp_path):
    port = free_port()
    path = write_files(tmp_path, port)
    plant = Plant(tmp_path, port)
    await plant.up()
    async with running(path) as daemon:
        await until(lambda: daemon.cycles >= 5)
        control = control_of(daemon)
        daemon.reload()
        await until(lambda: daemon._control is not control)
        assert control_of(daemon).plc is control.plc
        control = control_of(daemon)
        (tmp_path / "map.yaml").write_text((tmp_path / "map.yaml").read_text().replace("0.5 s", "0.6 s"))
        daemon.reload()
        await until(lambda: daemon._control is not control)
        assert control_of(daemon).plc is not control.plc
        cycles = daemon.cycles
        await until(lambda: daemon.cycles > cycles + 5 and last(daemon).image.link_ok)
    await plant.down()


@pytest.mark.parametrize("service", ["updates", "exchange", "planning", "status"])
async def test_a_service_that_fails_raises_an_alarm_and_stops_no_control(tmp_path, service):
    port = free_port()
    path = write_files(tmp_path, port)
    path.write_text(path.read_text() + "exchange: exchange\n")
    plant = Plant(tmp_path, port)
    await plant.up()

    def broken(*_):
        raise ZeroDivisionError("a bug")

    async with running(path) as daemon:
        await until(lambda: daemon.cycles >= 2)
        call = {"planning": "latest", "status": "publish"}.get(service, "tick")
        owner = getattr(daemon.services, service)
        works = getattr(owner, call)
        setattr(owner, call, broken)
        cycles = daemon.cycles
        await until(lambda: daemon.cycles > cycles + 10)
        assert plant.shows("heating_setpoint") != 17.0
        (alarm,) = daemon._journal.alarms.active
        assert alarm.text == f"{service} failed: ZeroDivisionError: a bug"
        setattr(owner, call, works)
        await until(lambda: not daemon._journal.alarms.active)
    await plant.down()


async def test_a_restart_gives_back_no_daily_budget(tmp_path):
    port = free_port()
    registers = MAP.replace("unit: degC, writable: true", "unit: degC, writable: true, non_volatile: true")
    path = write_files(tmp_path, port, map_text=registers)
    path.write_text(path.read_text() + "guard: {non_volatile_daily_budget: 4}\n")
    # Three writes at this drift reach the safe value, so that the stop needs none of the reserve.
    site = tmp_path / "site.yaml"
    site.write_text(site.read_text() + "crop: {agronomy: {temperature_drift: 4}}\n")
    plant = Plant(tmp_path, port)
    await plant.up()
    written = []
    write = plant.plc.write

    def watched(function, address, values):
        if address == 0:
            written.append(values)
        write(function, address, values)

    plant.plc.write = watched
    for _ in range(3):
        async with running(path) as daemon:
            await until(lambda: daemon.cycles >= 40)
    await plant.down()
    assert len(written) == 3
    rows = read_records(tmp_path / "state" / "store", "write")
    assert any("3 of 4 writes of the last 24 h are used" in str(row.body["reason"]) for row in rows)


@pytest.mark.parametrize(("clock", "interval"), [("lockstep", "5 min"), ("system", "1 s")])
async def test_a_cycle_that_hangs_feeds_the_watchdog_no_more(tmp_path, clock, interval):
    class Recorder:
        feed_every = 0.02

        def __init__(self):
            self.sent = []

        def ready(self):
            self.sent.append("ready")

        def reloading(self):
            self.sent.append("reloading")

        def stopping(self):
            self.sent.append("stopping")

        def cycle_completed(self, status):
            self.sent.append(status)

        def still_waiting(self):
            self.sent.append("waiting")

        def close(self):
            return

    port = free_port()
    path = write_files(tmp_path, port, clock=clock, interval=interval)
    plant = Plant(tmp_path, port)
    await plant.up()
    recorder = Recorder()
    async with running(path, notifier=recorder) as daemon:
        await until(lambda: daemon.cycles >= 3)
        go_on = asyncio.Event()
        plc = control_of(daemon).cycle._plc
        read = plc.read

        hangs = []

        async def hanging_read(names=None):
            hangs.append(True)
            await go_on.wait()
            return await read(names)

        assert ("waiting" in recorder.sent) == (clock == "system")
        plc.read = hanging_read
        await until(lambda: hangs)
        fed = len(recorder.sent)
        cycles = daemon.cycles
        await asyncio.sleep(0.3)
        assert (daemon.cycles, len(recorder.sent)) == (cycles, fed)
        go_on.set()
        await until(lambda: len(recorder.sent) > fed)
    await plant.down()
