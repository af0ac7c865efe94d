"""The commands as a user meets them: help, one-line errors, and what they print."""

from __future__ import annotations

import asyncio
import errno
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from igrow.core.errors import IgrowError
from igrow.core.greenhouse.described import parse_effect
from igrow.edge.cli import COMMANDS, main
from igrow.edge.cli.common import parse_duration, parse_time
from igrow.edge.cli.plan import table
from igrow.edge.cli.probe import parse_units
from igrow.edge.cli.simulate_plc import make_plant
from igrow.edge.cli.status import lines
from igrow.edge.ports import Plan
from igrow.edge.sources.override import read_leases
from igrow.edge.state_lock import StateLock
from tests.control.daemon_bench import Plant, free_port, running, status_port, until, write_files
from tests.service.attacked_daemon import DAEMON, SITE
from tests.service.test_exchanged_units import MAP as TWO_UNITS


def call(capsys, *arguments: object) -> tuple[int, str, str]:
    try:
        code = main([str(argument) for argument in arguments])
    except SystemExit as end:
        code = int(end.code or 0)
    printed = capsys.readouterr()
    return code, printed.out, printed.err


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help_with_an_example(capsys, command):
    code, out, _ = call(capsys, command, "--help")
    assert code == 0
    assert f"example:\n  {'sudo -u igrow ' if command == 'restore' else ''}igrow-edge {command}" in out


def test_a_wrong_configuration_is_one_line_and_exit_code_2(tmp_path, capsys):
    path = write_files(tmp_path, 5020)
    path.write_text(path.read_text().replace("clock: lockstep", "clock: lockstap"))
    code, out, err = call(capsys, "check-config", path)
    assert (code, out) == (2, "")
    assert re.fullmatch(r"error: .*daemon.yaml:6:33: cycle.clock is 'lockstap': did you mean lockstep\?\n", err)


def test_a_missing_file_is_one_line_and_exit_code_2(tmp_path, capsys):
    code, _, err = call(capsys, "run", tmp_path / "none.yaml")
    assert code == 2
    assert err.count("\n") == 1
    assert "none.yaml" in err


def test_check_config_says_what_a_configuration_means(tmp_path, capsys):
    code, out, _ = call(capsys, "check-config", write_files(tmp_path, 5020))
    assert code == 0
    assert "heating_setpoint: 12 to 28, safe 18, 4 per hour" in out
    assert re.search(r"bus line is busy \d+ % of the time", out)
    assert "interlock wind: NOT AT WORK, as nothing that it moves can be written (vent_" in out


@pytest.mark.parametrize(
    ("heating", "dosing", "identities"),
    [("", "", 0), ("11", "", 1), ("11", "12", 2)],
)
def test_check_config_says_which_units_can_be_told_apart(tmp_path, capsys, heating, dosing, identities):
    shown = {"heating": heating, "dosing": dosing}
    text = TWO_UNITS.replace("{{", "{").replace("}}", "}").replace("{host}", "127.0.0.1").replace("{port}", "5020")
    for unit, content in shown.items():
        identity = f", identity: {{function: input, address: 2, content: [{content}]}}" if content else ""
        text = text.replace(f"{{{unit}}}", identity)
    for name, content in {"map.yaml": text, "site.yaml": SITE, "daemon.yaml": DAEMON}.items():
        (tmp_path / name).write_text(content)
    code, out, _ = call(capsys, "check-config", tmp_path / "daemon.yaml")
    assert code == 0
    assert [line for line in out.splitlines() if line.startswith("  identity")] == [
        f"  identity  {unit}: {content} in input 2" for unit, content in shown.items() if content
    ]
    assert ("dosing and heating have their setpoints in the same registers" in out) == (identities == 0)


def test_check_config_names_files_that_are_not_there_and_a_crop_that_is_described_as_another(tmp_path, capsys):
    path = write_files(tmp_path, 5020)
    more = (
        "transfer: {known_hosts: hosts, identity: key}\nupdates: {trusted_root: root.json}\n"
        "exchange: sftp://igrow@trainer.example/srv/igrow\n"
    )
    path.write_text(path.read_text() + more)
    (tmp_path / "site.yaml").write_text((tmp_path / "site.yaml").read_text() + "crop: {species: lettuce}\n")
    code, out, _ = call(capsys, "check-config", path)
    assert code == 0
    for key, name in (
        ("transfer.known_hosts", "hosts"),
        ("transfer.identity", "key"),
        ("updates.trusted_root", "root.json"),
    ):
        assert f"note      {key}: {tmp_path / name} is not there" in out
    assert "crop.species is lettuce, but dry_matter_fraction (0.09), fruit_share (0.7)" in out
    assert "agronomy are those of a tomato: state this crop's own" in out


def test_an_override_is_left_for_the_daemon_and_given_back(tmp_path, capsys):
    path = write_files(tmp_path, 5020)
    leases = tmp_path / "state" / "override.json"
    leases.parent.mkdir()
    assert call(capsys, "override", path, "heating_setpoint=21", "--for", "30 min")[0] == 0
    assert read_leases(leases)["heating_setpoint"].seconds == 1800.0
    assert "limits are 12 to 28" in call(capsys, "override", path, "heating_setpoint=50")[2]
    assert "is no setpoint of this site" in call(capsys, "override", path, "lamp_on=1")[2]
    assert call(capsys, "override", path, "--clear")[1] == "nothing is overridden\n"
    assert read_leases(leases) == {}
    assert call(capsys, "override", path, "--recipe", "--for", "1 day")[1] == "the recipe rules for 1 day\n"
    assert call(capsys, "override", path, "--clear", "recipe")[1] == "nothing is overridden\n"


async def test_an_override_reaches_the_plc_and_status_says_so(tmp_path, capsys):
    port = free_port()
    path = write_files(tmp_path, port)
    plant = Plant(tmp_path, port)
    await plant.up()
    async with running(path) as daemon:
        await until(lambda: plant.shows("heating_setpoint") == 19.0)
        await asyncio.to_thread(main, ["override", str(path), "heating_setpoint=17", "--for", "300 d"])
        await until(lambda: plant.shows("heating_setpoint") == 17.0)
        status = ["status", str(path), "--port", str(status_port(daemon))]
        text, said = "", "heating_setpoint       asked 17, written 17, PLC shows 17 degC (override)"
        for _ in range(200):
            # The daemon sees what it wrote with its next reading.
            assert await asyncio.to_thread(main, status) == 0
            text = capsys.readouterr().out
            if said in text:
                break
            await asyncio.sleep(0.05)
        assert said in text
        assert await asyncio.to_thread(main, [*status, "--json"]) == 0
    await plant.down()
    state = json.loads(capsys.readouterr().out)
    assert state["link_ok"] is True
    assert next(iter(lines(state))).startswith("test-greenhouse: ")


def test_status_without_a_daemon_says_so(tmp_path, capsys):
    code, _, err = call(capsys, "status", write_files(tmp_path, 5020), "--port", free_port())
    assert code == 2
    assert "is igrow-edge running?" in err


async def test_status_of_a_stopped_daemon_is_the_last_state_it_left(tmp_path, capsys):
    port = free_port()
    path = write_files(tmp_path, port)
    path.write_text(path.read_text().replace("port: 0", f"port: {free_port()}"))
    plant = Plant(tmp_path, port)
    await plant.up()
    async with running(path) as daemon:
        await until(lambda: daemon.cycles >= 5)
    await plant.down()
    capsys.readouterr()
    code, out, err = call(capsys, "status", path)
    assert code == 0
    assert out.startswith("test-greenhouse: ")
    assert "the last state that it left" in err


async def test_backup_export_and_restore_go_round(tmp_path, capsys):
    port = free_port()
    path = write_files(tmp_path, port)
    plant = Plant(tmp_path, port)
    await plant.up()
    async with running(path) as daemon:
        await until(lambda: daemon.cycles >= 30)
    await plant.down()
    archive = tmp_path / "backup.tar.gz"
    assert main(["backup", str(path), str(archive)]) == 0
    assert main(["export", str(path), str(tmp_path / "first"), "--from", "2026-03-01", "--until", "2026-03-02"]) == 0
    (tmp_path / "state").rename(tmp_path / "away")
    assert main(["restore", str(path), str(archive)]) == 0
    assert main(["export", str(path), str(tmp_path / "second"), "--from", "2026-03-01", "--until", "2026-03-02"]) == 0
    names = {file.name for file in (tmp_path / "first").iterdir()}
    assert {"events.csv", "writes.csv", "telemetry-2026-03-01.csv.gz"} <= names
    assert (tmp_path / "first" / "writes.csv").read_text() == (tmp_path / "second" / "writes.csv").read_text()
    assert "backup.tar.gz" in capsys.readouterr().out


def test_a_store_is_restored_only_while_no_daemon_has_it(tmp_path, capsys):
    path = write_files(tmp_path, 5020)
    lock = StateLock(tmp_path / "state")
    lock.hold()
    for arguments in (["restore", path, tmp_path / "backup.tar.gz"], ["run", path], ["commission", path]):
        code, _, err = call(capsys, *arguments)
        assert code == 2
        assert re.fullmatch(r"error: \S*/state: a daemon is running on it; stop it first, .*\n", err)
    lock.let_go()
    assert "the backup cannot be restored" in call(capsys, "restore", path, tmp_path / "backup.tar.gz")[2]


def test_a_walk_before_the_first_start_leaves_no_folder_that_the_service_could_not_write_to(
    tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr("igrow.edge.commission.LINE_SECONDS", 0.1)
    path = write_files(tmp_path, free_port())
    code, out, _ = call(capsys, "commission", path)
    assert code == 1
    assert "no point can be read" in out
    assert not (tmp_path / "state").exists()


def test_an_override_before_the_first_start_leaves_no_folder_either(tmp_path, capsys):
    path = write_files(tmp_path, 5020)
    code, _, err = call(capsys, "override", path, "heating_setpoint=21")
    assert code == 2
    assert f"{tmp_path / 'state'}: is not there; the daemon makes it when it first starts" in err
    assert not (tmp_path / "state").exists()


def test_a_user_who_cannot_see_the_lock_is_told_whose_rights_it_takes(tmp_path, capsys, monkeypatch):
    path = write_files(tmp_path, 5020)
    real = os.open

    def barred(file, *arguments, **named):
        if Path(file).name == "lock":
            raise PermissionError(errno.EACCES, "Permission denied", str(file))
        return real(file, *arguments, **named)

    monkeypatch.setattr("igrow.edge.state_lock.os.open", barred)
    code, _, err = call(capsys, "commission", path)
    assert code == 2
    assert "cannot be told: Permission denied" in err
    assert "sudo -u igrow" in err


async def test_probe_shows_raw_and_decoded_values(tmp_path, capsys):
    port = free_port()
    write_files(tmp_path, port)
    plant = Plant(tmp_path, port)
    await plant.up()
    arguments = ["probe", "--tcp", f"127.0.0.1:{port}", "--function", "holding", "--count", "3"]
    assert await asyncio.to_thread(main, arguments) == 0
    await plant.down()
    out = capsys.readouterr().out
    assert "float32  ABCD 17 " in out
    assert "0x4188" in out


@pytest.mark.parametrize(
    ("where", "reason"),
    [
        (["--tcp", "127.0.0.1:9"], "no connection to 127.0.0.1:9: Connection refused"),
        (["--tcp", "nohost.invalid"], "no connection to nohost.invalid:502: "),
        (["--serial", "/dev/ttyNone"], "no connection to /dev/ttyNone: No such file or directory"),
    ],
)
def test_probe_says_why_a_line_cannot_be_opened(capsys, caplog, where, reason):
    code, out, _ = call(capsys, "probe", *where, "--timeout", "5")
    assert code == 1
    assert out.endswith("not connected\n")
    assert reason in caplog.text


def test_simulate_plc_serves_what_mean_commands_ask_for(tmp_path):
    write_files(tmp_path, 0)
    (tmp_path / "map.yaml").write_text((tmp_path / "map.yaml").read_text().replace("port: 0", "port: 1"))
    process = subprocess.Popen(
        [sys.executable, "-m", "igrow.edge.cli", "simulate-plc", "--map", str(tmp_path / "map.yaml"), "--port", "0",
         "--pace", "lockstep", "--days", "3", "--effect", "wind_infiltration@2020-01-16"],
        stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        assert process.stdout is not None
        line = process.stdout.readline()
        found = re.search(r":(\d+),", line)
        assert found is not None
        port = found[1]
        assert "plant time 2020-01-15T00:00:00" in line
        probe = [
            sys.executable,
            "-m",
            "igrow.edge.cli",
            "probe",
            "--tcp",
            f"127.0.0.1:{port}",
            "--function",
            "input",
            "--count",
            "2",
        ]
        assert "answers" in subprocess.run(probe, capture_output=True, text=True, check=True).stdout
    finally:
        process.terminate()
        assert process.wait(60) == 0


def test_an_effect_is_written_with_size_and_start():
    effect = parse_effect("wind_infiltration=0.001@2020-03-14")
    assert (effect.name, effect.size, effect.start) == (
        "wind_infiltration",
        0.001,
        np.datetime64("2020-03-14T00:00:00"),
    )
    assert parse_effect("wind_infiltration").start is None
    for text, message in (("wind_infiltration=much", "SIZE"), ("wind", "no effect is called"), ("a@b", "START")):
        with pytest.raises(IgrowError, match=message):
            parse_effect(text)


def test_the_same_seed_gives_the_same_plant():
    def course(seed):
        plant = make_plant(None, weather=None, start=None, days=2.0, seed=seed, effects=[])
        plant.step(3600.0, {})
        return plant.measurements()

    assert course(1) == course(1)
    assert course(1) != course(2)


@pytest.mark.parametrize(
    ("text", "seconds"), [("90 s", 90.0), ("30min", 1800.0), ("2 h", 7200.0), ("1.5 days", 129_600.0)]
)
def test_durations_are_read(text, seconds):
    assert parse_duration(text) == seconds


@pytest.mark.parametrize("text", ["", "5", "h", "-1 h", "nan h", "1 fortnight", "9999 days"])
def test_what_is_no_duration_is_refused(text):
    with pytest.raises(IgrowError, match="duration"):
        parse_duration(text)


def test_a_time_without_zone_is_utc():
    assert parse_time("1970-01-02") == 86_400.0
    assert parse_time("1970-01-01T01:00:00+01:00") == 0.0
    with pytest.raises(IgrowError, match="is no time"):
        parse_time("tomorrow")


def test_unit_numbers_are_read():
    assert parse_units("1,4,8-10") == [1, 4, 8, 9, 10]
    for text in ("", "a", "300", "5-2"):
        with pytest.raises(IgrowError, match="--units"):
            parse_units(text)


def test_a_plan_is_printed_as_a_table():
    plan = Plan(
        0.0, 0.0, 3600.0, {"heating_setpoint": (18.0, 19.0)}, 7200.0, "b1", 0.5, 0.25, leaves_range=True,
        predicted={"air_temperature": (18.5, 19.25)},
    )  # fmt: skip
    from zoneinfo import ZoneInfo

    printed = list(table(plan, ZoneInfo("Europe/Amsterdam")))
    assert printed[1] == "expected  0.5000 EUR m-2 by the plan, 0.2500 by the recipe"
    assert printed[2].startswith("careful")
    assert printed[-1].split() == ["1970-01-01", "02:00", "19", "19.25"]
