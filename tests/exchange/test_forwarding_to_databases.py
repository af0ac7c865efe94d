"""Collected days in InfluxDB and PostgreSQL: real servers hold every value once, however often they are written."""

from __future__ import annotations

import contextlib
import json
import os
import pwd
import shutil
import subprocess
import urllib.parse
import urllib.request
from collections.abc import Iterator
from datetime import UTC, date, datetime
from pathlib import Path

import numpy as np
import pytest

from igrow.core.errors import IgrowError
from igrow.core.telemetry import Telemetry
from igrow.trainer.service.archive import Archive
from igrow.trainer.service.forwarding import forward, line_protocol
from tests import needs
from tests.exchange.peers import INSTALL, _wait_for_port, free_port

TODAY = date(2026, 2, 20)
START = int(datetime(2026, 2, 16, tzinfo=UTC).timestamp())


@pytest.fixture
def archive(tmp_path: Path) -> Archive:
    made = Archive(tmp_path / "archive")
    (tmp_path / "archive" / "ledger").mkdir(parents=True)
    time = (START + np.arange(0, 2 * 86_400, 3600)).astype("datetime64[s]")
    humidity = np.full(48, 80.5)
    humidity[3] = np.nan
    made.add_telemetry(
        "greenhouse 1", Telemetry(time, {"air_temperature": np.linspace(18, 22, 48), "air_humidity": humidity})
    )
    return made


@pytest.fixture(scope="module")
def influx(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    program = needs.program("influxd", INSTALL)
    folder, port, other = tmp_path_factory.mktemp("influx"), free_port(), free_port()
    (folder / "influx.conf").write_text(
        f'reporting-disabled = true\nbind-address = "127.0.0.1:{other}"\n[meta]\n  dir = "{folder}/meta"\n'
        f'[data]\n  dir = "{folder}/data"\n  wal-dir = "{folder}/wal"\n[http]\n  bind-address = "127.0.0.1:{port}"\n'
        "[monitor]\n  store-enabled = false\n"
    )
    with (folder / "log").open("wb") as log:
        server = subprocess.Popen([program, "-config", str(folder / "influx.conf")], stdout=log, stderr=log)
    try:
        _wait_for_port(port, server, folder / "log")
        ask(f"http://127.0.0.1:{port}", "CREATE DATABASE igrow")
        yield f"http://127.0.0.1:{port}"
    finally:
        server.terminate()
        server.wait()


def ask(server: str, query: str) -> dict:
    data = urllib.parse.urlencode({"q": query, "db": "igrow"}).encode()
    with urllib.request.urlopen(f"{server}/query", data=data, timeout=60) as answer:
        found: dict = json.load(answer)
    return found


def test_influxdb_holds_each_value_once(archive: Archive, influx: str) -> None:
    target = f"{influx}/write?db=igrow"
    assert forward(archive, "greenhouse 1", target, TODAY) == (2, 95)
    assert forward(archive, "greenhouse 1", target, TODAY) == (0, 0), "unchanged days are left out"
    shutil.rmtree(archive.root / "ledger")
    (archive.root / "ledger").mkdir()
    forward(archive, "greenhouse 1", target, TODAY)
    counted = "count(air_temperature), count(air_humidity), max(air_temperature)"
    query = f"SELECT {counted} FROM greenhouse WHERE site='greenhouse 1'"
    (row,) = ask(influx, query)["results"][0]["series"][0]["values"]
    assert row[1:3] == [48, 47]
    assert row[3] == pytest.approx(22.0)


def test_a_day_that_changes_is_written_again(archive: Archive, influx: str) -> None:
    target = f"{influx}/write?db=igrow"
    forward(archive, "greenhouse 1", target, TODAY)
    late = Telemetry(np.array([START + 90], dtype="datetime64[s]"), {"air_temperature": np.array([30.0])})
    archive.add_telemetry("greenhouse 1", late)
    assert forward(archive, "greenhouse 1", target, TODAY)[0] == 1


def test_a_database_that_is_not_there_or_refuses_is_one_sentence(archive: Archive, influx: str, tmp_path: Path) -> None:
    with pytest.raises(IgrowError, match="refused with 404"):
        forward(archive, "greenhouse 1", f"{influx}/write?db=none", TODAY)
    with pytest.raises(IgrowError, match="refused"):
        forward(archive, "greenhouse 1", f"http://127.0.0.1:{free_port()}/write?db=x", TODAY)
    with pytest.raises(IgrowError, match="is right"):
        forward(archive, "greenhouse 1", str(tmp_path / "x.csv"), TODAY)


def as_postgres() -> dict[str, object]:
    """PostgreSQL does not run as root."""
    if os.geteuid() != 0:
        return {}
    account = pwd.getpwnam("postgres")
    return {"user": account.pw_uid, "group": account.pw_gid}


@pytest.fixture(scope="module")
def postgresql() -> Iterator[str]:
    import tempfile

    programs = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"))
    if not programs:
        needs.absent("postgresql", f"sh {INSTALL}")
    binaries, port = programs[-1].parent, free_port()
    with tempfile.TemporaryDirectory(prefix="igrow-postgresql-") as text:
        folder = Path(text)
        options = as_postgres()
        if options:
            os.chown(folder, int(str(options["user"])), int(str(options["group"])))
        subprocess.run(
            [str(binaries / "initdb"), "-D", str(folder / "data"), "-A", "trust", "-U", "igrow", "-N"],
            check=True, stdout=subprocess.DEVNULL, cwd="/", **options,  # type: ignore[call-overload]
        )  # fmt: skip
        server = subprocess.Popen(
            [str(binaries / "postgres"), "-D", str(folder / "data"), "-p", str(port), "-k", str(folder),
             "-c", "listen_addresses=127.0.0.1"],
            stderr=subprocess.DEVNULL, cwd="/", **options,  # type: ignore[call-overload]
        )  # fmt: skip
        try:
            _wait_for_port(port, server, folder / "none")
            yield f"postgresql://igrow@127.0.0.1:{port}/postgres"
        finally:
            server.terminate()
            server.wait()


def connected(target: str):
    import time

    import psycopg

    for _ in range(100):
        with contextlib.suppress(psycopg.OperationalError):
            return psycopg.connect(target)
        time.sleep(0.1)
    raise AssertionError("PostgreSQL does not start")


def test_postgresql_holds_each_value_once(archive: Archive, postgresql: str, tmp_path: Path) -> None:
    connected(postgresql).close()
    assert forward(archive, "greenhouse 1", postgresql, TODAY) == (2, 95)
    shutil.rmtree(archive.root / "ledger")
    (archive.root / "ledger").mkdir()
    forward(archive, "greenhouse 1", postgresql, TODAY)
    script = tmp_path / "log.sql"
    forward(archive, "greenhouse 1", str(script), TODAY)
    with connected(postgresql) as connection:
        connection.execute(script.read_text())
        rows = connection.execute(
            "SELECT quantity, count(*), max(value), min(time) FROM telemetry GROUP BY 1 ORDER BY 1"
        ).fetchall()
    assert [(name, count) for name, count, _, _ in rows] == [("air_humidity", 47), ("air_temperature", 48)]
    assert rows[1][2] == pytest.approx(22.0)
    assert rows[1][3] == datetime(2026, 2, 16, tzinfo=UTC)


def test_names_with_signs_of_the_line_protocol_are_escaped() -> None:
    rows = Telemetry(np.array([START], dtype="datetime64[s]"), {"air_temperature": np.array([20.123456789])})
    assert list(line_protocol("a b,c=d", rows)) == [f"greenhouse,site=a\\ b\\,c\\=d air_temperature=20.12346 {START}"]
