"""State, health and metrics for programs, over a real socket."""

from __future__ import annotations

import asyncio
import json

import pytest

from igrow.edge.records import AlarmRecord
from igrow.edge.status import StatusServer
from tests.status.status_helpers import NOW, snapshot


@pytest.fixture
async def server():
    made = StatusServer(0)
    await made.start()
    yield made
    await made.close()


async def fetch(server: StatusServer, request: bytes) -> tuple[int, str, str]:
    """Return status, header and body."""
    reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
    writer.write(request)
    answer = (await reader.read()).decode()
    writer.close()
    head, _, body = answer.partition("\r\n\r\n")
    return int(head.split()[1]), head, body


async def get(server: StatusServer, path: str) -> tuple[int, str]:
    status, _, body = await fetch(server, f"GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
    return status, body


async def test_before_the_first_cycle_nothing_is_claimed(server: StatusServer) -> None:
    assert (await get(server, "/state.json"))[0] == 503
    status, body = await get(server, "/health")
    assert status == 503
    assert json.loads(body)["ok"] is False


async def test_health_follows_link_and_cycles() -> None:
    now = 0.0
    server = StatusServer(0, late_after=60.0, wall=lambda: now)
    await server.start()
    server.publish(snapshot())
    assert (await get(server, "/health"))[0] == 200
    server.publish(snapshot(link_ok=False))
    status, body = await get(server, "/health")
    assert (status, json.loads(body)["why"]) == (503, "the PLC does not answer")
    server.publish(snapshot())
    now = 61.0
    status, body = await get(server, "/health")
    assert (status, json.loads(body)["why"]) == (503, "no cycle was completed lately")
    await server.close()


async def test_the_first_address_says_where_people_look(server: StatusServer) -> None:
    server.publish(snapshot())
    status, body = await get(server, "/")
    assert status == 200
    assert "http://localhost:8421" in body


async def test_metrics_are_prometheus_text_with_one_type_for_each_name(server: StatusServer) -> None:
    server.publish(snapshot())
    status, body = await get(server, "/metrics")
    assert status == 200
    names = [line.split()[2] for line in body.splitlines() if line.startswith("# TYPE")]
    assert len(names) == len(set(names))
    assert 'igrow_value{point="air_temperature",unit="degC"} 20.6' in body
    assert 'igrow_live_error{quantity="air_temperature",horizon="24_h",unit="degC"} 0.54' in body
    assert "igrow_cycles_total 12345" in body
    for line in body.splitlines():
        if not line.startswith("#"):
            float(line.rsplit(" ", 1)[1])
    # A value that was never read has no sample.
    assert 'igrow_value{point="sky_temperature"' not in body


async def test_metrics_escape_what_would_end_a_label(server: StatusServer) -> None:
    server.publish(snapshot(alarms=(AlarmRecord(NOW, 1.0, 'odd"name\n', True, ""),)))
    _, body = await get(server, "/metrics")
    assert r'igrow_alarm{name="odd\"name\n"} 1' in body


async def test_the_state_is_strict_json(server: StatusServer) -> None:
    server.publish(snapshot())
    _, body = await get(server, "/state.json")
    state = json.loads(body, parse_constant=lambda word: pytest.fail(f"{word} is no JSON"))
    assert state["values"]["wind_speed"]["quality"] == "frozen"
    assert state["values"]["sky_temperature"]["age"] is None
    assert state["plan"]["expected_profit"] == 0.214


async def test_the_server_only_reads(server: StatusServer) -> None:
    server.publish(snapshot())
    status, _, _ = await fetch(server, b"POST / HTTP/1.1\r\nHost: localhost\r\n\r\n")
    assert status == 405
    assert (await get(server, "/etc/passwd"))[0] == 404
    status, _, body = await fetch(server, b"HEAD / HTTP/1.1\r\nHost: localhost\r\n\r\n")
    assert (status, body) == (200, "")


@pytest.mark.parametrize("request_bytes", [b"\r\n\r\n", b"\xff\xfe\r\n\r\n", b"GET\r\n\r\n"])
async def test_garbage_is_answered_with_a_refusal(server: StatusServer, request_bytes: bytes) -> None:
    status, _, _ = await fetch(server, request_bytes)
    assert status == 405


async def test_an_endless_request_is_cut_off(server: StatusServer) -> None:
    reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
    writer.write(b"GET / HTTP/1.1\r\nX: " + b"a" * 100_000)
    assert await reader.read() == b""
    writer.close()


async def test_too_many_visitors_are_turned_away_and_the_next_is_served(server: StatusServer) -> None:
    server.publish(snapshot())
    idle = [await asyncio.open_connection("127.0.0.1", server.port) for _ in range(20)]
    await asyncio.sleep(0.05)
    assert (await get(server, "/health"))[0] == 503
    for _, writer in idle:
        writer.close()
    await asyncio.sleep(0.05)
    assert (await get(server, "/health"))[0] == 200


async def test_a_port_that_is_taken_is_a_problem_and_no_reason_to_stop(server: StatusServer) -> None:
    second = StatusServer(server.port)
    await second.start()
    assert f"port {server.port}" in second.health
    second.publish(snapshot())
    await second.close()


async def test_the_last_state_is_left_in_a_file_for_when_nobody_listens(tmp_path) -> None:
    server = StatusServer(0, tmp_path / "status.json")
    await server.start()
    server.publish(snapshot())
    left = json.loads((tmp_path / "status.json").read_text())
    assert left["port"] == server.port
    assert left["state"]["why"] == snapshot().why
    server.publish(snapshot(why="another reason"))
    await server.close()
    assert json.loads((tmp_path / "status.json").read_text())["state"]["why"] == "another reason"


async def test_a_state_file_that_cannot_be_written_is_a_problem_and_no_reason_to_stop(tmp_path) -> None:
    (tmp_path / "file").write_text("no folder")
    server = StatusServer(0, tmp_path / "file" / "status.json")
    server.publish(snapshot())
    assert "status.json" in server.health


@pytest.mark.parametrize(
    ("host", "status"),
    [
        ("Host: localhost:8420", 200),
        ("Host: 127.0.0.1", 200),
        ("Host: [::1]:8420", 200),
        ("host: LOCALHOST", 200),
        ("Host: evil.example", 421),
        ("Host: localhost.evil.example", 421),
        ("Host: localhost:8420.evil.example", 421),
        ("Host: localhost\r\nHost: evil.example", 421),
        ("X-Forwarded-Host: localhost", 421),
    ],
)
async def test_a_name_that_points_here_from_elsewhere_is_not_served(
    server: StatusServer, host: str, status: int
) -> None:
    server.publish(snapshot())
    assert (await fetch(server, f"GET /state.json HTTP/1.1\r\n{host}\r\n\r\n".encode()))[0] == status
