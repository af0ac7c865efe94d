"""The whole daemon on servers that nobody here wrote: it reads, decides, guards, writes, and sees writes confirmed."""

from __future__ import annotations

import contextlib
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from igrow.edge.store import read_records
from tests.control.daemon_bench import running as running_daemon
from tests.control.daemon_bench import until
from tests.peers.test_peers import HERE, LIBMODBUS, free_port, libmodbus, node_package, running, serial_pair

PEERS = ["libmodbus tcp", "libmodbus rtu", "modbus-serial tcp", "modbus-serial rtu", "jsmodbus tcp"]

UNITS = {"libmodbus": 17, "modbus-serial": 1, "jsmodbus": 1}
FIRST = {"libmodbus": 0x160, "modbus-serial": 10, "jsmodbus": 10}
SCALE = {"libmodbus": 1.0, "modbus-serial": 0.02, "jsmodbus": 0.007}
TEMPERATURE = {"libmodbus": 0.0, "modbus-serial": 20.2, "jsmodbus": 21.07}
"""What the first register's content (0, 1010, 3010) is with that scale."""

MAP = """
title: peer
source: the peer's own
buses:
  line: {bus}
devices:
  plc: {{bus: line, device_id: {unit}}}
points:
  air_temperature: {{device: plc, function: holding, address: {first}, type: uint16, scale: {scale}, unit: degC}}
  co2_setpoint:
    {{device: plc, function: holding, address: {setpoint}, type: int16, scale: 0.1, unit: ppm, writable: true}}
  heartbeat: {{device: plc, function: holding, address: {heartbeat}, type: uint16, unit: "1", writable: true}}
"""

SITE = """
name: peer
latitude: 52
longitude: 4.5
setpoints: [co2_setpoint]
limits:
  co2_setpoint: {low: 400, high: 1000, safe: 400, slew: null, minimum_interval: 0 s}
"""

DAEMON = """
site: site.yaml
register_map: map.yaml
state: state
bundle: null
status: {port: 0}
cycle: {interval: 1 s}
planning: {enabled: false}
guard: {interlocks: []}
recipe:
  co2_setpoint: [{at: 00:00, value: 1200}]
"""


@contextlib.asynccontextmanager
async def configured_for(peer: str, folder: Path) -> AsyncIterator[Path]:
    """Run the peer; yield the file of a daemon that controls it."""
    name, line = peer.split()
    if name == "libmodbus":
        libmodbus()
        command = ["stdbuf", "-oL", str(LIBMODBUS)]
    else:
        node_package(name)
        command = ["node", str(HERE / f"{name.replace('-', '_')}_server.js")]
    async with contextlib.AsyncExitStack() as stack:
        if line == "rtu":
            ours, theirs = await stack.enter_async_context(serial_pair(folder))
            bus = f"{{transport: rtu, serial_port: {ours}, parity: none, gap: 0.01 s, timeout: 0.2 s}}"
            command += ["rtu", theirs]
        else:
            port = free_port()
            bus = f"{{transport: tcp, host: 127.0.0.1, port: {port}}}"
            command += [str(port)] if name == "jsmodbus" else ["tcp", str(port)]
        first, unit, scale = FIRST[name], UNITS[name], SCALE[name]
        text = MAP.format(bus=bus, unit=unit, first=first, scale=scale, setpoint=first + 5, heartbeat=first + 6)
        (folder / "map.yaml").write_text(text)
        (folder / "site.yaml").write_text(SITE)
        (folder / "daemon.yaml").write_text(DAEMON)
        await stack.enter_async_context(running(*command, ready="" if name == "libmodbus" else "ready"))
        yield folder / "daemon.yaml"


@pytest.mark.parametrize("peer", PEERS)
async def test_the_daemon_runs_on(peer: str, tmp_path: Path) -> None:
    async with configured_for(peer, tmp_path) as path, running_daemon(path) as daemon:

        def outcomes() -> set[object]:
            return {record.body["outcome"] for record in read_records(tmp_path / "state" / "store", "write")}

        def shown(name: str) -> float | None:
            assert daemon.last is not None
            return daemon.last.image.value_of(name).value

        await until(lambda: daemon.cycles and outcomes() >= {"clamped", "written", "confirmed"})
        beat = shown("heartbeat")
        await until(lambda: shown("heartbeat") != beat)
        assert shown("air_temperature") == pytest.approx(TEMPERATURE[peer.split(maxsplit=1)[0]])
        assert shown("co2_setpoint") == pytest.approx(1000.0)  # the recipe asks for 1200, beyond the limit
