"""An approved test, end to end: the command, the daemon, Modbus, and a mechanistic greenhouse on a calm night."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from igrow.core.greenhouse import GreenhouseParameters, VirtualGreenhouse
from igrow.core.separating_tests import SEPARATING_TESTS, SOURCE
from igrow.core.telemetry import Telemetry
from igrow.edge.cli import main
from igrow.edge.daemon import Daemon
from igrow.edge.registers.loading import load_register_map
from igrow.edge.separating_tests.runner import BEGAN_ANEW, COMPLETED
from igrow.edge.store import read_records, read_telemetry
from igrow.edge.virtual_plc.pace import Lockstep
from igrow.edge.virtual_plc.virtual_plc import VirtualPlc
from tests.control.daemon_bench import control_of, free_port, running, until

ROOT = Path(__file__).resolve().parents[2]
START = np.datetime64("2026-03-10T17:00:00", "s")
TEST = SEPARATING_TESTS["vent_square_wave"]
PATIENCE = 300.0
DAEMON = """
site: site.yaml
register_map: map.yaml
state: state
bundle: null
status: {port: 0}
cycle: {interval: 5 min, clock: lockstep}
planning: {enabled: false}
updates: {enabled: false}
separating_tests: {permitted: true}
guard:
  points:
    vent_lee: {low: 0, high: 60, safe: 0, slew: 200, dead_band: 1, minimum_interval: 3 min}
"""


def weather() -> Telemetry:
    """Two calm and mild days, as dark as nights."""
    time = START + np.arange(0, 48 * 12) * np.timedelta64(300, "s")
    values = {
        "outdoor_temperature": 9.0, "outdoor_humidity": 75.0, "outdoor_co2": 420.0, "global_radiation": 0.0,
        "wind_speed": 2.0, "sky_temperature": 0.0, "wind_direction": 90.0, "rain": 0.0,
    }  # fmt: skip
    return Telemetry(time, {name: np.full(len(time), value) for name, value in values.items()})


class Greenhouse:
    """The folder of a site, and its greenhouse behind Modbus."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.port = free_port()
        template = (ROOT / "config/register-maps/virtual-plc.yaml").read_text()
        (folder / "map.yaml").write_text(template.replace("port: 5020", f"port: {self.port}"))
        (folder / "site.yaml").write_text("name: test-greenhouse\nlatitude: 52\nlongitude: 4.5\n")
        self.path = folder / "daemon.yaml"
        self.path.write_text(DAEMON)
        self.plant = VirtualGreenhouse(GreenhouseParameters(), weather(), START, seed=3)
        self.plc = VirtualPlc(self.plant, load_register_map(folder / "map.yaml"), Lockstep(300.0))

    @asynccontextmanager
    async def daemon(self) -> AsyncIterator[Daemon]:
        async with running(self.path) as daemon:
            await until(lambda: daemon.cycles >= 2, PATIENCE)
            yield daemon

    async def command(self, *arguments: str) -> int:
        return await asyncio.to_thread(main, ["separating-test", str(self.path), *arguments])

    def log(self) -> Telemetry:
        """The log of a daemon that has ended."""
        return read_telemetry(self.folder / "state" / "store", 0.0, 4e9)

    def rows(self, category: str) -> list[dict[str, Any]]:
        """What the ledger holds, oldest first."""
        newest_first = read_records(self.folder / "state" / "store", category)
        return [dict(record.body) for record in reversed(newest_first)]

    def events(self, kind: str) -> list[dict[str, Any]]:
        return [row["detail"] for row in self.rows("event") if row["kind"] == kind]


@pytest.fixture
def greenhouse(tmp_path: Path) -> Greenhouse:
    return Greenhouse(tmp_path)


async def test_an_approved_test_runs_once_within_the_limits_and_the_log_says_so(greenhouse: Greenhouse) -> None:
    await greenhouse.plc.start(port=greenhouse.port)
    async with greenhouse.daemon() as daemon:
        assert await greenhouse.command("--approve", TEST.name, "--by", "Anna") == 0
        await until(lambda: greenhouse.events("separating_test_ended"), PATIENCE)
        cycles = daemon.cycles
        await until(lambda: daemon.cycles > cycles + 8, PATIENCE)
        rules = control_of(daemon).configuration.guard_rules.points["vent_lee"]
        assert control_of(daemon).cycle.state.points["vent_lee"].taken is None, "the PLC has its vents back"
    await greenhouse.plc.close()

    assert greenhouse.events("separating_test_approved")[0]["by"] == "Anna"
    (began,) = greenhouse.events("separating_test_began")
    assert began["test"] == TEST.name
    (ended,) = greenhouse.events("separating_test_ended")
    assert ended["why"] == COMPLETED
    assert ended["minutes"] == pytest.approx(TEST.minutes, abs=10.0)

    writes = [row for row in greenhouse.rows("write") if row["point"] == "vent_lee" and row["outcome"] == "written"]
    asked = [row for row in writes if row["source"] == SOURCE]
    assert {round(row["applied"]) for row in asked} >= {5, 15}
    assert all(rules.low <= row["applied"] <= rules.high for row in writes)
    for one, two in itertools.pairwise(writes):
        assert two["monotonic"] - one["monotonic"] >= rules.minimum_interval
    assert not [row for row in greenhouse.rows("write") if row["source"] == SOURCE and row["point"] != "vent_lee"]

    log = greenhouse.log()
    marked = log[SOURCE] > 0.5
    assert marked.sum() == pytest.approx(TEST.minutes / 5.0, abs=8)
    assert not marked[:2].any()
    assert not marked[-4:].any()
    assert np.nanmax(log["vent_lee"][marked]) == pytest.approx(15.0, abs=0.2)
    # The greenhouse felt it: the mechanistic plant exchanged air.
    assert log["vent_lee"][marked].std() > 3.0


async def test_a_test_that_was_cut_short_by_a_restart_is_over_and_its_vents_go_back(greenhouse: Greenhouse) -> None:
    await greenhouse.plc.start(port=greenhouse.port)
    async with greenhouse.daemon():
        assert await greenhouse.command("--approve", TEST.name) == 0
        await until(lambda: greenhouse.plc.memory.value("vent_lee") == pytest.approx(15.0, abs=0.3), PATIENCE)
    assert not greenhouse.events("separating_test_ended")
    async with greenhouse.daemon() as daemon:
        await until(lambda: greenhouse.events("separating_test_ended"), PATIENCE)
        await until(lambda: control_of(daemon).cycle.state.points["vent_lee"].taken is None, PATIENCE)
    await greenhouse.plc.close()
    assert greenhouse.events("separating_test_ended")[0]["why"] == BEGAN_ANEW
    assert len(greenhouse.events("separating_test_began")) == 1
    # The stop, or else the start, put the vents where they stood before.
    back = [row for row in greenhouse.rows("write") if row["source"] == SOURCE and row["reason"].startswith("back to")]
    assert back
    assert all(row["applied"] < 14.0 for row in back)


async def test_a_withdrawn_test_ends_and_a_second_one_waits_for_the_first(
    greenhouse: Greenhouse, capsys: pytest.CaptureFixture[str]
) -> None:
    await greenhouse.plc.start(port=greenhouse.port)
    async with greenhouse.daemon():
        assert await greenhouse.command("--approve", TEST.name) == 0
        assert await greenhouse.command("--approve", "dosing_pause") == 2
        assert "vent_square_wave is approved already" in capsys.readouterr().err
        await until(lambda: greenhouse.events("separating_test_began"), PATIENCE)
        assert await greenhouse.command("--withdraw", "--by", "Anna") == 0
        await until(lambda: greenhouse.events("separating_test_ended"), PATIENCE)
    await greenhouse.plc.close()
    assert greenhouse.events("separating_test_ended")[0]["why"] == "withdrawn by Anna"


async def test_what_is_not_permitted_or_not_possible_is_refused_in_a_line(
    greenhouse: Greenhouse, capsys: pytest.CaptureFixture[str]
) -> None:
    assert await greenhouse.command("--approve", "no_such_test") == 2
    assert "is no separating test" in capsys.readouterr().err
    allowed = greenhouse.path.read_text()
    for text, said in (
        (allowed.replace("permitted: true", "permitted: false"), "are not permitted here"),
        (allowed.replace("high: 60", "high: 10"), "the limits are 0 % to 10 %"),
        (allowed[: allowed.index("guard:")], "the gateway does not write vent_lee"),
    ):
        greenhouse.path.write_text(text)
        assert await greenhouse.command("--approve", TEST.name) == 2
        assert said in capsys.readouterr().err
    greenhouse.path.write_text(allowed)
    registers = greenhouse.folder / "map.yaml"
    registers.write_text(registers.read_text().replace(", refresh: 15 min", ""))
    assert await greenhouse.command("--approve", TEST.name) == 2
    assert "has no refresh" in capsys.readouterr().err
