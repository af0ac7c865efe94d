"""Random fault sequences between client and server, judged by recorded traffic.

Two invariants: no value is ever attributed to the wrong register, and nothing is written that was not asked for,
or more often than it was asked for. And one thing more: when the faults end, every unit answers again.
"""

from __future__ import annotations

import asyncio
import random
from collections import Counter

import pytest

from igrow.edge.bus.errors import BusError
from igrow.edge.bus.modbus_bus import ModbusBus
from igrow.edge.bus.owed import OwedAnswers
from igrow.edge.bus.protocol import Priority, ReadRequest, WriteRequest
from igrow.edge.bus.pymodbus_link import PymodbusLink
from igrow.edge.registers.model import BusSettings, Function, Transport
from igrow.edge.virtual_plc.modbus_server import ModbusServer
from tests.bus.coded_unit import CodedUnit, code
from tests.bus.fault_proxy import NETWORK, SERIAL, Fault, FaultProxy
from tests.bus.simulated_loop import run

TIMEOUT = 0.5
PATIENCE = 30.0
"""Seconds that a unit has, four times, to come back when the faults have ended."""
REST_STEPS = (0.0, 2.0)
UNITS = (1, 2)
REQUESTS = 12


class Sequence:
    """One run: a server, the proxy, a bus, and requests of all kinds."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.rtu = bool(seed % 2)
        self.seed = seed
        self.units = {device_id: CodedUnit(device_id) for device_id in UNITS}
        self.asked: Counter[tuple[int, int, tuple[int, ...]]] = Counter()
        self.confirmed: Counter[tuple[int, int, tuple[int, ...]]] = Counter()
        self.values_read = 0
        self.stamp = 0

    async def play(self) -> FaultProxy:
        loop = asyncio.get_running_loop()
        server = ModbusServer(self.units)
        behind = await server.listen("127.0.0.1", 0, rtu=self.rtu)
        rate = self.random.choice([0.1, 0.3, 0.6, 1.0])
        proxy = FaultProxy(behind, rtu=self.rtu, seed=self.seed, rate=rate, timeout=TIMEOUT)
        port = await proxy.listen()
        transport = Transport.RTU_OVER_TCP if self.rtu else Transport.TCP
        gap = 0.03 if self.rtu else 0.0
        settings = BusSettings("line", transport, host="127.0.0.1", port=port, timeout=TIMEOUT, gap=gap)
        rest_step = self.random.choice(REST_STEPS)
        bus = ModbusBus(settings, monotonic=loop.time, rest_step=rest_step, first_wait=PATIENCE / 60)
        bus.start()
        for _ in range(REQUESTS):
            together = self.random.choice([1, 1, 1, 3])
            jobs = [asyncio.ensure_future(self.request(bus)) for _ in range(together)]
            if self.random.random() < 0.1:
                await asyncio.sleep(self.random.uniform(0.0, TIMEOUT))
                jobs[0].cancel()
            for result in await asyncio.gather(*jobs, return_exceptions=True):
                if isinstance(result, BaseException) and not isinstance(result, (BusError, asyncio.CancelledError)):
                    raise result
            await asyncio.sleep(self.random.choice([0.0, 0.0, 0.1, 0.1 * PATIENCE]))
        proxy.rate = 0.0
        proxy.storm = 0
        await self.all_units_answer_again(bus)
        await bus.close()
        await server.close()
        proxy.close()
        self.judge_writes()
        return proxy

    async def request(self, bus: ModbusBus) -> None:
        device_id = self.random.choice(UNITS)
        priority = self.random.choice(list(Priority))
        if self.random.random() < 0.3:
            await self.write(bus, device_id, priority)
        else:
            function = self.random.choice([Function.HOLDING, Function.HOLDING, Function.INPUT, Function.COIL])
            address = self.random.randrange(0, 100)
            count = self.random.choice([1, 2, 2, 2, 60])
            await self.read(bus, ReadRequest(device_id, function, address, count), priority)

    async def read(self, bus: ModbusBus, request: ReadRequest, priority: Priority) -> None:
        content = await bus.read(request, priority)
        addresses = range(request.address, request.address + request.count)
        assert content == tuple(code(request.device_id, request.function, a) for a in addresses), (
            f"seed {self.seed}: wrong values for {request}"
        )
        self.values_read += len(content)

    async def write(self, bus: ModbusBus, device_id: int, priority: Priority) -> None:
        self.stamp += 1
        values = (self.stamp, self.seed & 0xFFFF)[: self.random.choice([1, 2])]
        address = self.random.randrange(300, 390)
        key = (device_id, address, values)
        self.asked[key] += 1
        await bus.write(WriteRequest(device_id, Function.HOLDING, address, values), priority)
        self.confirmed[key] += 1

    async def all_units_answer_again(self, bus: ModbusBus) -> None:
        await asyncio.sleep(2 * PATIENCE)
        for device_id in UNITS:
            for attempt in range(4):
                try:
                    await self.read(bus, ReadRequest(device_id, Function.INPUT, 5, 4), Priority.CONTROL)
                    break
                except BusError:
                    assert attempt < 3, f"seed {self.seed}: unit {device_id} does not come back"
                    await asyncio.sleep(PATIENCE)

    def judge_writes(self) -> None:
        done = Counter(
            (device_id, address, values) for device_id, unit in self.units.items() for _, address, values in unit.writes
        )
        assert done <= self.asked, f"seed {self.seed}: written without being asked: {done - self.asked}"
        assert self.confirmed <= done, f"seed {self.seed}: confirmed but not done: {self.confirmed - done}"


def play(seeds: range) -> tuple[Counter[Fault], int]:
    faults: Counter[Fault] = Counter()
    values = 0
    for seed in seeds:
        sequence = Sequence(seed)
        faults.update(run(sequence.play()).faults)
        values += sequence.values_read
    return faults, values


@pytest.mark.parametrize("start", range(0, 60, 10))
def test_no_value_goes_astray_and_no_write_is_invented_under_faults(start: int) -> None:
    _, values = play(range(start, start + 10))
    assert values > 100


def test_these_sequences_do_find_a_bus_that_trusts_a_late_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where nothing is owed and the line is free once nobody waits, values go astray: the judge is awake."""
    monkeypatch.setattr(OwedAnswers, "give_up", lambda self, request: None)
    monkeypatch.setattr(PymodbusLink, "exchanging", property(lambda self: False))
    monkeypatch.setattr("igrow.edge.bus.unit_health.HealthBook.rest_left", lambda self, device_id: 0.0)
    with pytest.raises(AssertionError, match="wrong values"):
        play(range(1, 401, 2))


@pytest.mark.soak
@pytest.mark.usefixtures("quiet")
@pytest.mark.parametrize("start", range(1000, 11000, 1000))
def test_ten_thousand_fault_sequences(start: int) -> None:
    faults, values = play(range(start, start + 1000))
    assert values > 10_000
    assert set(faults) == {*NETWORK, *SERIAL}
