"""The loop over real sockets with the real commands: a PLC, the daemon that controls it, a trainer's new bundle."""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from igrow.trainer.data.open_source import open_source
from tests.patience import PATIENCE

ROOT = Path(__file__).resolve().parents[2]
BIN = Path(sys.executable).parent


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Site:
    """A folder with everything that one greenhouse needs, and its running commands."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.running: list[subprocess.Popen[bytes]] = []
        demo = ROOT / "config/demo"
        shutil.copy(demo / "site.yaml", folder)
        daemon = (demo / "daemon.yaml").read_text()
        daemon = daemon.replace("shadow: 2 days", "shadow: 6 h").replace("planning:", "planning:\n  enabled: false")
        (folder / "daemon.yaml").write_text(daemon)
        registers = (ROOT / "config/register-maps/virtual-plc.yaml").read_text()
        (folder / "register-map.yaml").write_text(registers.replace("port: 5020", f"port: {free_port()}"))

    def run(self, *command: str) -> str:
        done = subprocess.run(
            [str(BIN / command[0]), *command[1:]], cwd=self.folder, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    def start(self, *command: str) -> subprocess.Popen[bytes]:
        with (self.folder / f"{command[1]}.log").open("wb") as log:
            process = subprocess.Popen(
                [str(BIN / command[0]), *command[1:]],
                cwd=self.folder,
                stdout=log,
                stderr=log,
                env=dict(os.environ, OMP_NUM_THREADS="1"),
            )
        self.running.append(process)
        return process

    def log(self, command: str) -> str:
        return (self.folder / f"{command}.log").read_text()

    def wait(self, happened: Callable[[], bool], what: str) -> None:
        limit = time.monotonic() + PATIENCE
        while not happened():
            assert time.monotonic() < limit, f"{what} did not happen; the daemon said: {self.log('run')[-2000:]}"
            assert all(process.poll() is None for process in self.running), self.log("run") + self.log("simulate-plc")
            time.sleep(0.1)

    def days(self) -> list[Path]:
        return sorted((self.folder / "exchange/demo/segments").glob("*.zip"))

    def reports(self, verdict: str) -> list[dict[str, object]]:
        paths = sorted((self.folder / "exchange/demo/reports").glob(f"*{verdict}.json"))
        return [json.loads(path.read_text()) for path in paths]


@pytest.fixture
def site(tmp_path: Path) -> Iterator[Site]:
    """A site whose keys are made and whose first bundle is exported."""
    made = Site(tmp_path)
    made.run("igrow-trainer", "keys", "create", "keys")
    shutil.copy(tmp_path / "keys/1.root.json", tmp_path / "root.json")
    made.run("igrow-trainer", "export", "--site", "site.yaml", "--out", "first-bundle")
    yield made
    for process in made.running:
        process.kill()
        process.wait()


def test_a_published_bundle_is_shadowed_and_adopted_while_the_daemon_controls(site: Site) -> None:
    site.run("igrow-trainer", "export", "--site", "site.yaml", "--bundle", "first-bundle", "--out", "second-bundle")
    site.start(
        *("igrow-edge", "simulate-plc", "--site", "site.yaml", "--map", "register-map.yaml"),
        *("--pace", "lockstep", "--start", "2020-02-01", "--days", "60", "--seed", "3"),
    )
    site.wait(lambda: "simulated PLC on" in site.log("simulate-plc"), "the virtual PLC")
    daemon = site.start("igrow-edge", "run", "daemon.yaml")
    site.wait(lambda: len(site.days()) >= 1, "a day of telemetry")
    site.run("igrow-trainer", "publish", "second-bundle", "--keys", "keys", "--exchange", "exchange")
    site.wait(lambda: bool(site.reports("adopted")), "the adoption")

    report = site.reports("adopted")[0]
    assert report["site"] == "demo"
    assert {row["quantity"] for row in report["comparison"]} == {"air_temperature", "air_humidity", "air_co2"}  # type: ignore[attr-defined]

    site.running.remove(daemon)
    daemon.send_signal(signal.SIGTERM)
    assert daemon.wait(60) == 0
    assert "the safe setpoints were written" in site.log("run")

    site.run("igrow-trainer", "collect", "demo", "--exchange", "exchange", "--state", "trainer")
    day = open_source(site.folder / "trainer/archive/telemetry/site=demo").telemetry
    commanded = day["heating_setpoint"]
    assert commanded.min() >= 12.0
    assert commanded.max() <= 28.0
    assert commanded.std() > 0.5
