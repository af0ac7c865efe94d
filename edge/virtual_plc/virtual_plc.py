"""The program of a virtual PLC: step the plant, publish what it measures, obey setpoints while somebody is alive."""

from __future__ import annotations

import asyncio
import logging
import math
from collections.abc import Awaitable, Callable, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from igrow.core.greenhouse.climate_computer import ClimateComputer
from igrow.core.quantities import ACTUATORS, QUANTITIES, SETPOINTS, USUAL_SETPOINTS
from igrow.edge.registers.model import Function, Parity, RegisterMap
from igrow.edge.virtual_plc.memory import DeviceMemory
from igrow.edge.virtual_plc.modbus_server import ModbusServer
from igrow.edge.virtual_plc.pace import Lockstep, Pace, Realtime
from igrow.edge.virtual_plc.plant import Plant

_log = logging.getLogger(__name__)

SAFE_SETPOINTS: Mapping[str, float] = MappingProxyType(
    {
        "heating_setpoint": 17.0,
        "co2_setpoint": 400.0,
        "lamp_on": 0.0,
        "irrigation_on": 0.1,
        "humidity_setpoint": ClimateComputer().humidity_start,
        "ventilation_setpoint": 20.0,
        "minimum_pipe_setpoint": 0.0,
        "energy_screen_setpoint": 100.0,
    }
)
"""What keeps a tomato crop alive without anybody's care: frost far away, no dosing, no lamps, some water, vents that
open before leaves get wet."""

PLANT_STEP = 5.0
"""Plant seconds between two programs runs in real time."""

SHORTEST_WAIT = 0.02
"""Wall seconds between two steps at high speed, so that requests are served between them."""


class VirtualPlc:
    """Serves one device of a register map over Modbus, with a plant behind it.

    The setpoints in force are those in the writable registers while the heartbeat register changes at least every
    `fallback_after` plant seconds. Otherwise, and before the first heartbeat, the PLC uses its own safe
    setpoints, shows them in the registers, and sets `plc_fallback`; what is written meanwhile is in force from the
    next heartbeat on. An opening that is written to a vent's register is in force until it is `refresh` old, in plant
    time; the register itself shows where the vent is.
    """

    def __init__(
        self,
        plant: Plant,
        register_map: RegisterMap,
        pace: Pace,
        *,
        device: str | None = None,
        safe_setpoints: Mapping[str, float] = SAFE_SETPOINTS,
        fallback_after: float = 900.0,
        sleep: Callable[[float], Awaitable[None]] = asyncio.sleep,
    ) -> None:
        """`device` names the map's device to play, its first by default. Made inside an event loop or not."""
        name = device or next(iter(register_map.devices))
        self.plant = plant
        self.memory = DeviceMemory(register_map, name)
        self.pace = pace
        self._fallback_after = fallback_after
        self._sleep = sleep
        self._server = ModbusServer({register_map.devices[name].device_id: self})
        self._setpoints = tuple(name for name in SETPOINTS if name in self.memory.points)
        # Without a register for it the computer goes by its own settings.
        taken = {*USUAL_SETPOINTS, *self._setpoints}
        self._safe = {name: value for name, value in safe_setpoints.items() if name in taken}
        self._lent = {name: point for name, point in self.memory.points.items() if point.writable and name in ACTUATORS}
        self._commanded: dict[str, tuple[float, np.datetime64]] = {}
        """What was written to each of them, and when."""
        self._heartbeat = self.memory.value("heartbeat") if "heartbeat" in self.memory.points else None
        self._heard: np.datetime64 | None = None
        self._task: asyncio.Task[None] | None = None
        self.fallback = False
        self.steps = 0
        """How often the plant was stepped."""
        for quantity in QUANTITIES.keys() & self.memory.points.keys():
            self.memory.set_value(quantity, math.nan)
        self._fall_back()
        self.publish()

    # the Modbus unit

    def read(self, function: Function, address: int, count: int) -> Sequence[int]:
        """Answer a client's read."""
        return self.memory.read(function, address, count)

    def write(self, function: Function, address: int, values: Sequence[int]) -> None:
        """Do a client's write, and look whether it was the heartbeat."""
        self.memory.write(function, address, values)
        for name, point in self._lent.items():
            if point.function is function and address <= point.address < address + len(values):
                value = self.memory.value(name)
                if value is not None:
                    self._commanded[name] = (value, self.plant.time)
        if "heartbeat" not in self.memory.points:
            return
        heartbeat = self.memory.value("heartbeat")
        if heartbeat != self._heartbeat:
            self._heartbeat = heartbeat
            self._heard = self.plant.time
            self._set_fallback(False)
            if isinstance(self.pace, Lockstep):
                self.advance(self.pace.interval)

    # the PLC's program

    def advance(self, seconds: float) -> None:
        """Step the plant once under the setpoints in force, and publish what came of it."""
        if self._heard is not None and self.plant.time - self._heard > np.timedelta64(
            round(1000 * self._fallback_after), "ms"
        ):
            self._fall_back()
        self.plant.step(seconds, self._setpoints_in_force())
        self.steps += 1
        self.publish()

    def publish(self) -> None:
        """Put the plant's measurements into the registers, and last the clock that says they are new."""
        for name, value in self.plant.measurements().items():
            if name in self.memory.points and name not in self._setpoints:
                self.memory.set_value(name, value)
        if "plc_clock" in self.memory.points:
            self.memory.set_value("plc_clock", float(self.plant.time.astype("datetime64[s]").astype(np.int64)))

    def set_by_hand(self, name: str, value: float) -> None:
        """Change a register at the PLC itself, as somebody does who stands before it."""
        self.memory.set_value(name, value)

    def _setpoints_in_force(self) -> dict[str, float]:
        setpoints = dict(self._safe)
        if self.fallback:
            return setpoints
        for name in self._setpoints:
            value = self.memory.value(name)
            if value is not None:
                setpoints[name] = value
        for name, (value, at) in self._commanded.items():
            refresh = self._lent[name].refresh
            if refresh is None or self.plant.time - at <= np.timedelta64(round(1000 * refresh), "ms"):
                setpoints[name] = value
        return setpoints

    def _fall_back(self) -> None:
        self._heard = None
        self._commanded.clear()
        self._set_fallback(True)
        for name in self._setpoints:
            if name in self._safe:
                self.memory.set_value(name, self._safe[name])

    def _set_fallback(self, fallback: bool) -> None:
        if fallback != self.fallback:
            _log.info("%s safe setpoints at %s", "falling back to" if fallback else "leaving", self.plant.time)
        self.fallback = fallback
        if "plc_fallback" in self.memory.points:
            self.memory.set_value("plc_fallback", float(fallback))

    # serving

    async def start(self, host: str = "127.0.0.1", port: int = 0, *, rtu: bool = False) -> int:
        """Listen on a TCP port (0 takes a free one), start the pace, return the port. Raises OSError."""
        bound = await self._server.listen(host, port, rtu=rtu)
        self._start_pace()
        return bound

    async def start_serial(self, serial_port: str, baudrate: int = 19200, parity: Parity = Parity.EVEN) -> None:
        """Answer on a serial port and start the pace. Raises OSError."""
        await self._server.serve_serial(serial_port, baudrate, parity)
        self._start_pace()

    def drop_connections(self) -> None:
        """Hang up on every client; it may connect again."""
        self._server.drop_connections()

    async def close(self) -> None:
        """Stop the plant and hang up."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)
            self._task = None
        await self._server.close()

    def _start_pace(self) -> None:
        if self._task is None and isinstance(self.pace, Realtime):
            self._task = asyncio.get_running_loop().create_task(self._run(self.pace.speed), name="virtual plant")

    async def _run(self, speed: float) -> None:
        """Step at the pace by the loop's clock; a plant too slow for it lags behind rather than takes longer steps."""
        loop = asyncio.get_running_loop()
        seconds = max(PLANT_STEP, SHORTEST_WAIT * speed)
        due = loop.time()
        while True:
            due = max(due + seconds / speed, loop.time())
            await self._sleep(max(0.0, due - loop.time()))
            self.advance(seconds)
