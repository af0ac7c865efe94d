"""The systemd unit: confined, watched, and never giving up."""

from __future__ import annotations

import configparser
import re
import subprocess
from pathlib import Path

from igrow.edge.daemon_file import STATUS_PORT
from tests import needs

ROOT = Path(__file__).resolve().parents[2]
UNIT = ROOT / "systemd" / "igrow-edge.service"


def service() -> dict[str, list[str]]:
    """Return the settings of the [Service] section; systemd allows a key more than once."""
    found: dict[str, list[str]] = {}
    section = ""
    for line in UNIT.read_text().splitlines():
        if line.startswith("["):
            section = line
        elif section == "[Service]" and "=" in line and not line.startswith("#"):
            key, value = line.split("=", 1)
            found.setdefault(key, []).append(value)
    return found


def test_the_exposure_by_systemd_s_own_measure_is_at_most_2() -> None:
    needs.program("systemd-analyze", "tests/peers/install.sh")
    done = subprocess.run(
        ["systemd-analyze", "security", "--offline=true", "--no-pager", str(UNIT)],
        check=False,
        capture_output=True,
        text=True,
    )
    level = re.search(r"Overall exposure level for igrow-edge\.service: ([\d.]+)", done.stdout)
    if level is None:
        needs.absent("systemd-analyze with offline analysis (systemd 250 or later)", done.stderr.strip()[:80])
    assert float(level[1]) <= 2.0


def test_systemd_finds_no_unknown_setting() -> None:
    needs.program("systemd-analyze", "tests/peers/install.sh")
    done = subprocess.run(["systemd-analyze", "verify", str(UNIT)], check=False, capture_output=True, text=True)
    complaints = [line for line in done.stderr.splitlines() if "igrow-edge" in line and "not executable" not in line]
    assert complaints == []


def test_the_watchdog_is_fed_through_notify_and_the_daemon_always_comes_back() -> None:
    settings = service()
    assert settings["Type"] == ["notify"]
    assert int(settings["WatchdogSec"][0]) > 0
    assert settings["Restart"] == ["always"]
    assert "StartLimitIntervalSec=0" in UNIT.read_text()


def test_the_unit_lets_the_daemon_listen_on_the_default_status_port() -> None:
    assert service()["SocketBindAllow"] == [f"ipv4:tcp:{STATUS_PORT}"]


def test_the_daemon_has_a_user_of_its_own_that_sysusers_makes() -> None:
    (user,) = service()["User"]
    text = UNIT.with_name("igrow-edge.sysusers.conf").read_text()
    assert re.search(rf"^u {user} ", text, re.MULTILINE)
    assert user != "root"


def test_the_unit_is_readable_as_an_ini_file_apart_from_repeated_keys() -> None:
    parser = configparser.ConfigParser(strict=False, interpolation=None)
    parser.optionxform = lambda optionstr: optionstr
    parser.read_string(UNIT.read_text())
    assert parser.sections() == ["Unit", "Service", "Install"]


def test_the_units_of_a_further_compartment_share_nothing_with_the_first(tmp_path: Path) -> None:
    page = (ROOT / "docs" / "installation.md").read_text()
    edit = re.search(r"sed ('s\|/etc/igrow/.*?') \|", page, re.DOTALL)
    assert edit is not None
    for unit in ("igrow-edge", "igrow-page"):
        first = (ROOT / "systemd" / f"{unit}.service").read_text()
        program = tmp_path / "edit"
        program.write_text(edit[1].strip("'"))
        made = subprocess.run(["sed", "-f", program], input=first, capture_output=True, text=True, check=True).stdout
        settings = [line for line in made.splitlines() if "=" in line and not line.startswith("#")]
        own = [line for line in settings if line not in first.splitlines()]
        assert not [line for line in settings if re.search(r"/etc/igrow/|/igrow-edge$|Directory=igrow$|842[01]", line)]
        assert len(own) == len([line for line in first.splitlines() if line not in made.splitlines()])
        assert any("/etc/igrow-b/daemon.yaml" in line for line in own)
