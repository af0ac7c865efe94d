"""`igrow-edge mqtt` as a process, at a broker that sends what no broker should."""

from __future__ import annotations

import asyncio
import os
import struct
import subprocess
from pathlib import Path
from typing import IO

from igrow.edge.configuration import load_configuration
from igrow.edge.overriding import override_file
from igrow.edge.sources.override import read_leases
from tests.control.daemon_bench import write_files
from tests.patience import PATIENCE
from tests.service.running_daemon import COMMAND, ROOT

CONNECT, PUBLISH, SUBSCRIBE = 0x10, 0x30, 0x80
AT = b"igrow/test-greenhouse/set/"


def publish(topic: bytes, payload: bytes) -> bytes:
    content = struct.pack(">H", len(topic)) + topic + payload
    assert len(content) < 128
    return bytes((PUBLISH, len(content))) + content


async def packet(reader: asyncio.StreamReader) -> tuple[int, bytes]:
    (kind,) = await reader.readexactly(1)
    length = place = 0
    while True:
        (byte,) = await reader.readexactly(1)
        length, place = length | (byte & 127) << place, place + 7
        if byte < 128:
            return kind, await reader.readexactly(length)


class HostileBroker:
    """Does what MQTT asks of it until somebody has subscribed, and then sends `what` for ever and now and then."""

    def __init__(self, what: bytes, times: int) -> None:
        self.what, self.times, self.sent, self.visits = what, times, 0, 0

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.visits += 1
        flood: asyncio.Task[None] | None = None
        try:
            while True:
                kind, content = await packet(reader)
                if kind & 0xF0 == CONNECT:
                    writer.write(b"\x20\x02\x00\x00")
                elif kind & 0xF0 == SUBSCRIBE:
                    writer.write(b"\x90\x03" + content[:2] + b"\x01")
                    flood = asyncio.create_task(self._flood(writer))
                elif kind & 0xF6 == PUBLISH | 2:
                    size = 2 + int.from_bytes(content[:2], "big")
                    writer.write(b"\x40\x02" + content[size : size + 2])
        except (OSError, asyncio.IncompleteReadError):
            pass
        finally:
            if flood is not None:
                flood.cancel()
            writer.close()

    async def _flood(self, writer: asyncio.StreamWriter) -> None:
        while True:
            writer.write(self.what * self.times)
            await writer.drain()
            self.sent += self.times
            await asyncio.sleep(0.05)


def start(configuration: Path, log: IO[bytes]) -> subprocess.Popen[bytes]:
    command = [*COMMAND, "mqtt", str(configuration)]
    return subprocess.Popen(command, stderr=log, env={**os.environ, "PYTHONPATH": str(ROOT)})


async def at_broker(folder: Path, what: bytes, times: int, enough: int) -> tuple[HostileBroker, str, dict[str, float]]:
    """Run the command until the broker has sent `enough` and the good message; returns its log and the overrides."""
    broker = HostileBroker(what, times)
    server = await asyncio.start_server(broker.serve, "127.0.0.1", 0)
    path = write_files(folder, 5020)
    port = server.sockets[0].getsockname()[1]
    with path.open("a") as file:
        file.write(f"mqtt: {{host: 127.0.0.1, port: {port}, every: 1 s, permit_override: true}}\n")
    (folder / "state").mkdir()
    leases = override_file(load_configuration(path).state_folder)
    with (folder / "mqtt.log").open("wb") as log:
        process = start(path, log)
    try:
        async with asyncio.timeout(PATIENCE):
            while broker.sent < enough or not read_leases(leases):
                assert process.poll() is None
                await asyncio.sleep(0.05)
    finally:
        process.kill()
        process.wait()
        server.close()
    found = {name: lease.value for name, lease in read_leases(leases).items()}
    return broker, (folder / "mqtt.log").read_text(), found


async def test_a_topic_that_is_no_text_is_passed_over(tmp_path: Path) -> None:
    what = publish(b"igrow/\xff\xfe/set/co2_setpoint", b"500") + publish(AT + b"co2_setpoint", b"600")
    broker, log, overrides = await at_broker(tmp_path, what, 1, 40)
    assert overrides == {"co2_setpoint": 600.0}
    assert broker.visits == 1
    assert "exception" not in log


async def test_a_flood_costs_few_lines_and_the_word_of_a_person_gets_through(tmp_path: Path) -> None:
    what = publish(AT + b"co2_setpoint", b"much") * 9 + publish(AT + b"co2_setpoint", b"600")
    _, log, overrides = await at_broker(tmp_path, what, 100, 20_000)
    assert overrides == {"co2_setpoint": 600.0}
    assert len(log.splitlines()) < 2000


async def test_what_nobody_asked_for_changes_nothing_and_no_topic_writes_a_line_of_the_log(tmp_path: Path) -> None:
    what = publish(b"other/set/co2_setpoint", b"500") + publish(AT + b"a\n12:00:00 INFO stopped", b"5")
    _, log, overrides = await at_broker(tmp_path, what + publish(AT + b"heating_setpoint", b"19"), 1, 10)
    assert overrides == {"heating_setpoint": 19.0}
    assert r"a\n12:00:00 INFO stopped" in log
    assert not [line for line in log.splitlines() if line.startswith("12:00:00 INFO stopped")]
