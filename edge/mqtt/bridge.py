"""The connection to the broker: publish each `every`, take commands, come back after every fault."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import ssl
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import aiomqtt

from igrow.core.errors import IgrowError
from igrow.edge.configuration import Configuration
from igrow.edge.mqtt.commands import Commands
from igrow.edge.mqtt.topics import base, discovery, state_payload

_log = logging.getLogger("igrow.edge.mqtt")
FIRST_PAUSE, LONGEST_PAUSE = 1.0, 60.0
"""Seconds between two attempts to connect; each failure doubles the pause."""
PATIENCE = 10.0
"""Seconds that the broker may take for one message."""
PAUSE_AFTER_COMMAND = 0.2
"""Seconds: however many messages a broker sends, few are looked at and told of, and those too many are lost."""
_library = logging.getLogger("igrow.edge.mqtt.library")
_library.setLevel(logging.CRITICAL)  # it says of each message of a flood what is said here once


class _Client(aiomqtt.Client):
    """Passes over a message whose topic is no text: the library would stumble over it again and again, for ever."""

    def _on_message(self, client: Any, userdata: Any, message: Any) -> None:
        with contextlib.suppress(ValueError):
            super()._on_message(client, userdata, message)


async def run_bridge(configuration: Configuration, fetch: Callable[[], Mapping[str, Any]]) -> None:
    """Publish until cancelled. `fetch` asks the daemon; it may block and raises IgrowError when nobody answers."""
    pause = FIRST_PAUSE
    while not _cancelled():
        try:
            async with _client(configuration) as client:
                pause = FIRST_PAUSE
                await _publish_all(client, configuration, fetch)
        except (aiomqtt.MqttError, OSError, TimeoutError) as error:
            _log.warning("no broker: %s; again in %.0f s", error or type(error).__name__, pause)
        await asyncio.sleep(pause)
        pause = min(2.0 * pause, LONGEST_PAUSE)


def _client(configuration: Configuration) -> _Client:
    settings, site = configuration.file.mqtt, configuration.site.name
    assert settings.host is not None
    return _Client(
        settings.host,
        settings.port,
        identifier=f"igrow-{site}",
        username=settings.username,
        password=_password(configuration),
        tls_context=ssl.create_default_context() if settings.tls else None,
        will=aiomqtt.Will(f"{base(settings.prefix, site)}/available", "offline", qos=1, retain=True),
        timeout=PATIENCE,
        logger=_library,
        max_queued_incoming_messages=100,
        max_queued_outgoing_messages=1000,
    )


def _password(configuration: Configuration) -> str | None:
    name = configuration.file.mqtt.password_file
    if name is None:
        return None
    path = Path(configuration.path.parent / name)
    try:
        return path.read_text("utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise IgrowError(f"{path}: the broker's password cannot be read: {error}") from None


async def _publish_all(
    client: aiomqtt.Client, configuration: Configuration, fetch: Callable[[], Mapping[str, Any]]
) -> None:
    settings, site = configuration.file.mqtt, configuration.site.name
    at, complained = base(settings.prefix, site), ""
    commands = asyncio.create_task(_take_commands(client, configuration, at))
    try:
        if settings.discovery is not None:
            for topic, payload in discovery(
                settings.prefix,
                settings.discovery,
                site,
                list(configuration.register_map.points),
                _limits(configuration),
            ):
                await client.publish(topic, payload, qos=1, retain=True)
        while not _cancelled():
            try:
                state = await asyncio.to_thread(fetch)
            except IgrowError as error:
                if str(error) != complained:  # once, and not every ten seconds of a long night
                    _log.warning("%s", error)
                complained = str(error)
                await client.publish(f"{at}/available", "offline", qos=1, retain=True)
            else:
                complained = ""
                await client.publish(f"{at}/state", state_payload(state), qos=0, retain=True)
                await client.publish(f"{at}/available", "online", qos=1, retain=True)
            done, _ = await asyncio.wait({commands}, timeout=settings.every.total_seconds())
            for task in done:
                task.result()  # the connection is gone: say so to whoever connects again
    finally:
        commands.cancel()
        with contextlib.suppress(asyncio.CancelledError, aiomqtt.MqttError):
            await commands


async def _take_commands(client: aiomqtt.Client, configuration: Configuration, at: str) -> None:
    if not configuration.file.mqtt.permit_override:
        await asyncio.Event().wait()
    commands = Commands(configuration)
    await client.subscribe(f"{at}/set/+", qos=1)
    async for message in client.messages:
        if message.retain or not message.topic.matches(f"{at}/set/+"):
            continue  # left there by somebody at some time: no word of this moment; or nothing that we asked for
        payload = message.payload if isinstance(message.payload, bytes) else b""
        setpoint = str(message.topic).rpartition("/")[2]
        _log.warning("%s", await asyncio.to_thread(commands.take, setpoint, payload, time.monotonic()))
        await asyncio.sleep(PAUSE_AFTER_COMMAND)


def _cancelled() -> bool:
    """Tell whether we were told to stop: a wait that ends at that very moment swallows the message (Python 3.11)."""
    task = asyncio.current_task()
    return task is not None and task.cancelling() > 0


def _limits(configuration: Configuration) -> dict[str, tuple[float, float, float]]:
    if not configuration.file.mqtt.permit_override:
        return {}
    rules = configuration.guard_rules.points
    return {
        name: (rules[name].low, rules[name].high, max(rules[name].resolution, 0.01)) for name in configuration.setpoints
    }
