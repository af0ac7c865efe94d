"""The state at a broker, and what may come back: a real broker, one that is down, and hostile messages."""

from __future__ import annotations

import asyncio
import contextlib
import json
import socket
import subprocess

import aiomqtt
import pytest

from igrow.core.errors import IgrowError
from igrow.edge.configuration import load_configuration
from igrow.edge.mqtt import bridge as module
from igrow.edge.mqtt.bridge import run_bridge
from igrow.edge.mqtt.commands import Commands
from igrow.edge.mqtt.topics import discovery, state_payload
from igrow.edge.overriding import override_file
from igrow.edge.sources.override import read_leases
from tests import needs
from tests.control.daemon_bench import free_port, write_files
from tests.patience import PATIENCE

STATE = {
    "time": 1.0,
    "link_ok": True,
    "source": "recipe",
    "why": "no plan yet",
    "values": {
        "air_temperature": {"value": 20.5, "quality": "good"},
        "air_co2": {"value": 4000.0, "quality": "frozen"},
    },
    "setpoints": {"heating_setpoint": {"shown": 18.0}},
    "alarms": [{"name": "sensor air_co2", "text": "frozen", "level": "warning"}],
    "plan": None,
}


def configured(tmp_path, port=1883, *, permit=False):
    path = write_files(tmp_path, 5020)
    with path.open("a") as file:
        file.write(f"mqtt: {{host: 127.0.0.1, port: {port}, every: 1 s, permit_override: {str(permit).lower()}}}\n")
    (tmp_path / "state").mkdir(exist_ok=True)
    return load_configuration(path)


def leases(configuration):
    return read_leases(override_file(configuration.state_folder))


def test_what_cannot_be_believed_is_not_published_as_a_value():
    payload = json.loads(state_payload(STATE))
    assert payload["values"] == {"air_temperature": 20.5}
    assert payload["setpoints"] == {"heating_setpoint": 18.0}
    assert payload["alarms"][0]["level"] == "warning"


def test_discovery_offers_numbers_only_where_overrides_are_permitted():
    plain = dict(discovery("igrow", "homeassistant", "hillside", ["air_temperature"], {}))
    assert not any("/number/" in topic for topic in plain)
    sensor = json.loads(plain["homeassistant/sensor/igrow_hillside/air_temperature/config"])
    assert sensor["unit_of_measurement"] == "°C"
    assert sensor["device_class"] == "temperature"
    permitted = dict(discovery("igrow", "homeassistant", "hillside", [], {"heating_setpoint": (12.0, 28.0, 0.1)}))
    number = json.loads(permitted["homeassistant/number/igrow_hillside/heating_setpoint/config"])
    assert (number["min"], number["max"]) == (12.0, 28.0)
    assert number["command_topic"] == "igrow/hillside/set/heating_setpoint"


def test_without_permission_a_message_changes_nothing(tmp_path):
    configuration = configured(tmp_path)
    assert "does not allow" in Commands(configuration).take("heating_setpoint", b"20", 0.0)
    assert leases(configuration) == {}


@pytest.mark.parametrize(
    ("setpoint", "payload"),
    [
        ("heating_setpoint", b"nan"),
        ("heating_setpoint", b"inf"),
        ("heating_setpoint", b"1e9"),
        ("heating_setpoint", b"-40"),
        ("heating_setpoint", b""),
        ("heating_setpoint", b"\xff\xfe"),
        ("heating_setpoint", b"20" + b" " * 10_000),
        ("vent_lee", b"20"),
        ("../../etc/passwd", b"20"),
        ("x" * 60_000, b"20"),
    ],
)
def test_a_hostile_message_changes_nothing_and_is_answered_in_one_short_line(tmp_path, setpoint, payload):
    configuration = configured(tmp_path, permit=True)
    line = Commands(configuration).take(setpoint, payload, 0.0)
    assert leases(configuration) == {}
    assert len(line) < 300
    assert "\n" not in line


def test_a_message_overrides_for_a_time_and_not_more_often_than_people_do(tmp_path):
    configuration = configured(tmp_path, permit=True)
    commands = Commands(configuration)
    assert commands.take("heating_setpoint", b"20", 0.0) == "heating_setpoint overridden to 20 degC by a message"
    assert leases(configuration)["heating_setpoint"].seconds == 7200.0
    for number in range(100):
        commands.take("heating_setpoint", b"22", 0.01 * number)
    assert leases(configuration)["heating_setpoint"].value == 20.0


def start(file):
    mosquitto = needs.program("mosquitto", "tests/peers/install.sh")
    return subprocess.Popen([mosquitto, "-c", str(file)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


async def until(condition):
    """Wait, generously, for what has to come."""
    async with asyncio.timeout(PATIENCE):
        while not condition():  # noqa: ASYNC110 - the condition is a file's or a server's, which no event tells of
            await asyncio.sleep(0.05)


@contextlib.asynccontextmanager
async def broker(tmp_path):
    """Run mosquitto on a free port of this machine."""
    port = free_port()
    file = tmp_path / "mosquitto.conf"
    file.write_text(f"listener {port} 127.0.0.1\nallow_anonymous true\npersistence false\n")
    process = start(file)
    try:
        for _ in range(600):
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), 0.2):
                break
            await asyncio.sleep(0.1)
        yield port
    finally:
        process.terminate()
        process.wait(PATIENCE)


@contextlib.asynccontextmanager
async def bridging(configuration, fetch):
    task = asyncio.create_task(run_bridge(configuration, fetch))
    try:
        yield task
    finally:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task


async def first(client, topic):
    async with asyncio.timeout(PATIENCE):
        async for message in client.messages:
            if str(message.topic) == topic:
                return message.payload.decode()
    raise AssertionError


async def test_a_real_broker_gets_state_discovery_and_the_last_will(tmp_path):
    async with broker(tmp_path) as port:
        configuration = configured(tmp_path, port)
        async with aiomqtt.Client("127.0.0.1", port) as client:
            await client.subscribe("igrow/#")
            await client.subscribe("homeassistant/#")
            async with bridging(configuration, lambda: STATE):
                assert "unique_id" in await first(
                    client, "homeassistant/sensor/igrow_test-greenhouse/air_temperature/config"
                )
                assert json.loads(await first(client, "igrow/test-greenhouse/state"))["source"] == "recipe"
                assert await first(client, "igrow/test-greenhouse/available") == "online"


async def test_a_daemon_that_does_not_answer_shows_as_offline(tmp_path):
    def silent():
        raise IgrowError("no daemon answers")

    async with broker(tmp_path) as port, aiomqtt.Client("127.0.0.1", port) as client:
        await client.subscribe("igrow/#")
        async with bridging(configured(tmp_path, port), silent):
            assert await first(client, "igrow/test-greenhouse/available") == "offline"


async def test_an_override_by_message_takes_effect_and_one_that_was_retained_does_not(tmp_path):
    async with broker(tmp_path) as port:
        configuration = configured(tmp_path, port, permit=True)
        async with aiomqtt.Client("127.0.0.1", port) as client:
            await client.publish("igrow/test-greenhouse/set/heating_setpoint", "25", retain=True)
            await client.subscribe("igrow/#")
            async with bridging(configuration, lambda: STATE):
                await first(client, "igrow/test-greenhouse/state")
                await client.publish("igrow/test-greenhouse/set/co2_setpoint", "600")
                await until(lambda: leases(configuration))
        assert {name: lease.value for name, lease in leases(configuration).items()} == {"co2_setpoint": 600.0}


async def test_a_broker_that_comes_up_later_is_found(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "FIRST_PAUSE", 0.05)
    monkeypatch.setattr(module, "LONGEST_PAUSE", 0.1)
    port = free_port()
    file = tmp_path / "mosquitto.conf"
    file.write_text(f"listener {port} 127.0.0.1\nallow_anonymous true\n")
    async with bridging(configured(tmp_path, port), lambda: STATE) as task:
        await asyncio.sleep(0.5)
        assert not task.done()
        process = start(file)
        try:
            async with asyncio.timeout(PATIENCE):
                while True:
                    with contextlib.suppress(aiomqtt.MqttError):
                        async with aiomqtt.Client("127.0.0.1", port) as client:
                            await client.subscribe("igrow/#")
                            assert await first(client, "igrow/test-greenhouse/available") == "online"
                            break
                    await asyncio.sleep(0.1)
        finally:
            process.terminate()
            process.wait(PATIENCE)


async def test_a_server_that_speaks_no_mqtt_is_tried_again_and_harms_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "FIRST_PAUSE", 0.05)
    monkeypatch.setattr(module, "LONGEST_PAUSE", 0.1)
    visits = 0

    async def babble(reader, writer):
        nonlocal visits
        visits += 1
        writer.write(b"HTTP/1.1 400 Bad Request\r\n\r\n" * 100)
        with contextlib.suppress(OSError):
            await writer.drain()
        writer.close()

    server = await asyncio.start_server(babble, "127.0.0.1", 0)
    port = server.sockets[0].getsockname()[1]
    async with bridging(configured(tmp_path, port), lambda: STATE) as task:
        await until(lambda: visits >= 2)
        assert not task.done()
    server.close()
