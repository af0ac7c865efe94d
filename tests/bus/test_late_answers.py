"""Late answers on a serial line: Modbus RTU has no transaction number, and yet none may pass for another value."""

from __future__ import annotations

import asyncio
import random
from collections import Counter
from dataclasses import dataclass, field

import pytest

from igrow.edge.bus.errors import BusError
from igrow.edge.bus.modbus_bus import ModbusBus
from igrow.edge.bus.owed import OwedAnswers
from igrow.edge.bus.protocol import Priority, ReadRequest, WriteRequest
from igrow.edge.registers.model import BusSettings, Function, Transport
from tests.bus.coded_unit import CodedUnit, code
from tests.bus.late_line import LateLine
from tests.bus.simulated_loop import run

TIMEOUT = 0.5
LATEST = 20.0
POLL = 2.0
BLOCKS = [
    ReadRequest(1, Function.HOLDING, 0, 2),
    ReadRequest(1, Function.HOLDING, 40, 2),
    ReadRequest(1, Function.INPUT, 10, 2),
    ReadRequest(1, Function.HOLDING, 100, 9),
    ReadRequest(2, Function.HOLDING, 0, 2),
    ReadRequest(2, Function.HOLDING, 7, 1),
    ReadRequest(2, Function.COIL, 16, 12),
    ReadRequest(2, Function.HOLDING, 254, 2),
]
"""Several of one length in one unit, so that their answers look alike; the last one ends where the unit does."""


@dataclass
class Tally:
    """What came of one line."""

    late: int = 0
    read: int = 0
    failed: int = 0
    requests: int = 0
    gaps: list[float] = field(default_factory=list)
    """Seconds from the beginning of a read that failed to the end of the next one of that block that did not."""

    def add(self, other: Tally) -> None:
        self.late += other.late
        self.read += other.read
        self.failed += other.failed
        self.requests += other.requests
        self.gaps += other.gaps

    def tell(self) -> None:
        """Print what it cost; `pytest -s` shows it."""
        gaps = sorted(gap / TIMEOUT for gap in self.gaps)
        median, most = gaps[len(gaps) // 2], gaps[int(0.95 * len(gaps))]
        print(
            f"\n{self.late} late answers, {self.read} blocks read, none wrong; {self.failed} failed; without a value, "
            f"in timeouts: median {median:.1f}, 95 % under {most:.1f}, longest {gaps[-1]:.1f}"
        )


async def poll_a_late_line(seed: int, *, in_order: bool, share: float, polls: int) -> Tally:
    """Poll units that answer late; AssertionError for a value that is not the register's own."""
    generator = random.Random(seed)
    units = {device_id: CodedUnit(device_id) for device_id in (1, 2)}
    line = LateLine(units, seed=seed, share=share, timeout=TIMEOUT, latest=LATEST, in_order=in_order)
    settings = BusSettings("line", Transport.RTU_OVER_TCP, "127.0.0.1", await line.listen(), timeout=TIMEOUT, gap=0.03)
    loop = asyncio.get_running_loop()
    bus = ModbusBus(settings, monotonic=loop.time)
    bus.start()
    tally, stamp = Tally(), 0
    waiting: dict[ReadRequest, float] = {}
    confirmed: Counter[tuple[int, tuple[int, ...]]] = Counter()
    for _ in range(polls):
        for block in BLOCKS:
            began = loop.time()
            try:
                content = await bus.read(block, Priority.CONTROL)
            except BusError:
                waiting.setdefault(block, began)
                tally.failed += 1
                continue
            addresses = range(block.address, block.address + block.count)
            truth = tuple(code(block.device_id, block.function, address) for address in addresses)
            assert content == truth, f"seed {seed}: {block} reads {content} instead of {truth}"
            tally.read += 1
            if block in waiting:
                tally.gaps.append(loop.time() - waiting.pop(block))
        stamp += 1
        request = WriteRequest(1, Function.HOLDING, 300 + 2 * generator.randrange(3), (stamp, seed & 0xFFFF))
        try:
            await bus.write(request, Priority.WRITE)
            confirmed[request.address, request.values] += 1
        except BusError:
            pass
        await asyncio.sleep(generator.uniform(0.0, 2 * POLL))
    await asyncio.sleep(2 * LATEST * TIMEOUT)
    done = Counter((address, values) for _, address, values in units[1].writes)
    assert confirmed <= done, f"seed {seed}: confirmed but not done: {confirmed - done}"
    assert max(done.values(), default=1) == 1, f"seed {seed}: done twice"
    await bus.close()
    tally.late, tally.requests = line.late, line.requests
    return tally


def play(seeds: range, polls: int = 60) -> Tally:
    total = Tally()
    for seed in seeds:
        share = random.Random(seed).choice([0.02, 0.1, 0.3])
        tally = run(poll_a_late_line(seed, in_order=bool(seed % 2), share=share, polls=polls))
        total.add(tally)
    return total


@pytest.mark.usefixtures("quiet")
def test_no_late_answer_passes_for_another_value() -> None:
    total = play(range(30))
    assert total.late > 300
    assert total.read > 3000


def test_these_lines_do_find_a_bus_that_forgets_what_is_owed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(OwedAnswers, "give_up", lambda self, request: None)
    with pytest.raises(AssertionError, match="reads"):
        play(range(20))


@pytest.mark.soak
@pytest.mark.usefixtures("quiet")
@pytest.mark.parametrize("in_order", [True, False], ids=["in order", "each in its own time"])
def test_ten_thousand_late_answers_up_to_twenty_timeouts(in_order: bool) -> None:
    total, seed = Tally(), 1000
    while total.late < 10_000:
        share = random.Random(seed).choice([0.02, 0.1, 0.3])
        total.add(run(poll_a_late_line(seed, in_order=in_order, share=share, polls=200)))
        seed += 1
    total.tell()


def test_what_late_answers_cost_in_time() -> None:
    """A line on which one answer in fifty is late: how long until a block that failed is read again."""
    total = Tally()
    for seed in range(20):
        total.add(run(poll_a_late_line(seed, in_order=False, share=0.02, polls=60)))
    assert len(total.gaps) > 50
    assert max(total.gaps) < (LATEST + 4) * TIMEOUT + 3 * 2 * POLL
    total.tell()
