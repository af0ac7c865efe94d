"""The control cycle on servers that nobody here wrote: read, decide, guard, write, and see the write confirmed."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from dataclasses import replace
from pathlib import Path

import pytest
from bus.test_daemon_fault_sequences import LoopClock
from control.control_fakes import FixedSource, MemoryStore

from edge.bus.plc import RegisterPlc
from edge.cycle import ControlCycle
from edge.guard import GuardedWriter, GuardRules, PointRule, Readback
from edge.journal import Journal
from edge.registers.loading import parse_register_map
from edge.registers.model import Parity, Transport
from edge.sensors import ImageBuilder, SensorRule
from peers.test_peers import HERE, LIBMODBUS, free_port, libmodbus, node_package, running, serial_pair

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
  line: {{transport: tcp, host: 127.0.0.1}}
devices:
  plc: {{bus: line, device_id: {unit}}}
points:
  air_temperature: {{device: plc, function: holding, address: {first}, type: uint16, scale: {scale}, unit: degC}}
  heating_setpoint:
    {{device: plc, function: holding, address: {setpoint}, type: int16, scale: 0.1, unit: degC, writable: true}}
  heartbeat: {{device: plc, function: holding, address: {heartbeat}, type: uint16, unit: "1", writable: true}}
"""
RULES = {"heating_setpoint": PointRule(low=12.0, high=28.0, safe=18.0, slew=None, dead_band=0.1, minimum_interval=0.0)}


@contextlib.asynccontextmanager
async def plc_of(peer: str, folder: Path) -> AsyncIterator[RegisterPlc]:
    """Run the peer and connect a Plc to it."""
    name, line = peer.split()
    if name == "libmodbus":
        libmodbus()
        command = ["stdbuf", "-oL", str(LIBMODBUS)]
    else:
        node_package(name)
        command = ["node", str(HERE / f"{name.replace('-', '_')}_server.js")]
    first = FIRST[name]
    text = MAP.format(unit=UNITS[name], first=first, scale=SCALE[name], setpoint=first + 5, heartbeat=first + 6)
    register_map = parse_register_map(text)
    bus = register_map.buses["line"]
    async with contextlib.AsyncExitStack() as stack:
        if line == "rtu":
            ours, theirs = await stack.enter_async_context(serial_pair(folder))
            bus = replace(bus, transport=Transport.RTU, serial_port=ours, parity=Parity.NONE, gap=0.01)
            command += ["rtu", theirs]
        else:
            port = free_port()
            bus = replace(bus, port=port)
            command += [str(port)] if name == "jsmodbus" else ["tcp", str(port)]
        ready = "" if name == "libmodbus" else "ready"
        await stack.enter_async_context(running(*command, ready=ready))
        plc = RegisterPlc(replace(register_map, buses={"line": bus}))
        plc.start()
        try:
            for _ in range(100):
                if (await plc.read())["air_temperature"].error is None:
                    break
                await asyncio.sleep(0.1)
            yield plc
        finally:
            await plc.close()


@pytest.mark.parametrize("peer", PEERS)
async def test_the_control_cycle_runs_on(peer: str, tmp_path: Path) -> None:
    async with plc_of(peer, tmp_path) as plc:
        store = MemoryStore()
        cycle = ControlCycle(
            plc,
            LoopClock(),
            ImageBuilder({name: SensorRule(-1e6, 1e6, stale_after=30.0) for name in plc.register_map.points}),
            [FixedSource({"heating_setpoint": 99.0})],
            GuardRules(RULES, ()),
            Readback(RULES, confirm_within=60.0, respect_hand=0.0),
            GuardedWriter(plc, has_heartbeat=True),
            Journal(store),
            setpoints=tuple(RULES),
            respect_hand=0.0,
        )
        images = [(await cycle.run()).image for _ in range(3)]
    assert images[-1].value_of("air_temperature").value == pytest.approx(TEMPERATURE[peer.split(maxsplit=1)[0]])
    assert images[-1].value_of("heating_setpoint").value == pytest.approx(28.0)  # asked for 99, held to the limit
    beats = [image.value_of("heartbeat").value for image in images]
    assert len(set(beats)) == 3
    assert "confirmed" in {record.outcome for record in store.writes}
