"""Seeded sequences of everything that went wrong somewhere: a control cycle, its buses and PLCs, and the truth.

Networks spoil answers; a bus goes down while another is up; PLCs start anew, fall back, cap and round; registers hold
NaN and infinity; clocks jump by years; the disk hangs; hands set values; sources ask for anything; the daemon is
stopped and killed. In all of them:

1. no value outside the guard's limits is ever written;
2. no value is ever taken for another's, and no hand is lost or invented;
3. each cycle ends within its time, the heartbeat goes on with it, and a stop leaves the safe setpoints within ten
   seconds, or names what it could not leave so.
"""

from __future__ import annotations

import asyncio
import math
import random
from collections.abc import Awaitable, Callable, Iterator
from dataclasses import dataclass, field
from random import Random

import pytest

from igrow.edge.bus.modbus_bus import ModbusBus
from igrow.edge.guard import PointRule
from igrow.edge.guard.heartbeat import KEPT
from igrow.edge.image import Image, Quality
from igrow.edge.sources import Offer
from igrow.edge.stopping import STOP_SECONDS
from tests.bus.fault_proxy import Fault
from tests.bus.hanging_store import HangingStore
from tests.bus.plc_bench import INTERVAL, RULES, SAFE, SENSORS, PlcBench, make_plc_bench
from tests.bus.simulated_loop import run
from tests.control.control_fakes import FixedSource, MemoryStore

RESPECT = 600.0
WISHES = {"heating_setpoint": 21.0, "co2_setpoint": 700.0, "lamp_on": 1.0, "irrigation_on": 0.5}
WILD = (math.nan, math.inf, -math.inf, 1e9, -1e9, 0.0, -40.0, 5000.0)
LONGEST_CYCLE = 25.0
"""Seconds: a dozen requests that all time out, each with the quiet after it."""
YEAR = 366 * 86_400.0


class WildSource:
    """Asks for anything."""

    name = "plan"

    def __init__(self, generator: random.Random) -> None:
        self._random = generator

    def offer(self, image: Image) -> Offer:
        return Offer("wild", {name: self._wish(rule) for name, rule in RULES.items()})

    def _wish(self, rule: PointRule) -> float:
        return self._random.choice((*WILD, *(self._random.uniform(rule.low - 5, rule.high + 5) for _ in range(8))))


@dataclass
class Hand:
    """What somebody has set, and when."""

    value: float
    at: float
    known: bool = False
    """The daemon has noticed it."""


@dataclass(repr=False)
class World:
    """A bench, and what is really so."""

    random: random.Random
    bench: PlcBench
    rates: dict[str, float]
    wild: bool
    fallback_after: float
    disk: HangingStore | None
    wishes: dict[str, float] = field(default_factory=lambda: dict(WISHES))
    hands: dict[str, Hand] = field(default_factory=dict)
    made: dict[str, list[float]] = field(default_factory=dict)
    spoiled: set[str] = field(default_factory=set)
    """Sensors that hold no number, or did when they were last read."""
    anew: bool = False
    """The PLC has started anew, and nobody has read all of it since: a hand in between looks like it."""
    exchanged: bool = False
    """Each unit answers under the other's number; `written` is how much had been written before."""
    written: int = 0
    judged: dict[str, int] = field(default_factory=dict)
    seen: int = 0
    stopped: int = 0
    longest: float = 0.0
    happened: list[str] = field(default_factory=list)
    settling: int = 25
    """Cycles within which everything stands where it should when all is well again."""

    @property
    def now(self) -> float:
        return self.bench.clock.monotonic()

    @property
    def records(self) -> MemoryStore:
        return self.disk.kept if self.disk is not None else self.bench.store

    # cycles

    async def run(self, cycles: int) -> None:
        for _ in range(cycles):
            await self.cycle()
            await asyncio.sleep(INTERVAL)
            self.fall_back_where_nobody_beats()

    async def cycle(self) -> None:
        began = self.now
        result = await self.bench.cycle.run()
        self.longest = max(self.longest, self.now - began)
        assert self.now - began < LONGEST_CYCLE, f"a cycle took {self.now - began:.1f} s"
        plc = self.bench.units["plc"].points.keys() & RULES.keys()
        self.anew &= any(result.image.value_of(name).age > INTERVAL / 2 for name in plc)
        self.judge_values(result.image)
        self.judge_writes(stopping=False)
        self.judge_hands()

    def fall_back_where_nobody_beats(self) -> None:
        """The PLC puts its safe setpoints into its registers when it has heard no heartbeat for long."""
        unit = self.bench.units["plc"]
        beaten_at = unit.beaten_at()
        if beaten_at is not None and self.now - beaten_at > self.fallback_after:
            for name in unit.points.keys() & SAFE.keys():
                unit.set_value(name, SAFE[name])
                self.hands.pop(name, None)

    # judges

    def judge_values(self, image: Image) -> None:
        if self.exchanged:
            assert self.writes() == self.written, "a write to units that have changed places"
        for name, truth in SENSORS.items():
            one = image.value_of(name)
            value = None if one.quality is Quality.IMPLAUSIBLE else one.value
            if value is None or (name in self.spoiled and not math.isfinite(value)):
                continue
            assert value == truth, f"{name} reads {value}, not {truth}"
            self.seen += 1

    def judge_writes(self, *, stopping: bool) -> None:
        for unit in self.bench.units.values():
            for name, rows in unit.received.items():
                fresh = rows[self.judged.get(name, 0) :]
                self.judged[name] = len(rows)
                if name not in RULES:
                    continue
                for at, value in fresh:
                    assert RULES[name].low <= value <= RULES[name].high, f"{name} was written {value}"
                    self.judge_hand(name, at, value, stopping=stopping)

    def judge_hand(self, name: str, at: float, value: float, *, stopping: bool) -> None:
        hand = self.hands.get(name)
        if hand is None or at >= hand.at + RESPECT:
            return
        if stopping and not hand.known:
            del self.hands[name]  # its unit could not be looked at in time, and the stop is for the plant's safety
            return
        assert value == hand.value, f"{value} was written to {name}, where a hand had set {hand.value}"

    def judge_hands(self) -> None:
        told: dict[str, list[float]] = {}
        for kind, detail in self.records.events:
            if kind == "changed_by_hand":
                told.setdefault(str(detail["point"]), []).append(float(str(detail["shown"])))
        for name, values in told.items():
            made = iter(self.made.get(name, []))
            for value in values:
                assert any(value == real for real in made), f"a hand at {name} was invented: {value}"
        held = self.bench.cycle.readback.hands(self.now)
        for name, hand in self.hands.items():
            hand.known |= name in held and held[name].value == hand.value

    # what happens

    def hand(self) -> None:
        name = self.random.choice(list(RULES))
        rule, memory = RULES[name], self.bench.cycle.readback.points[name]
        value = round(self.random.uniform(rule.low, rule.high) * 16) / 16  # exact in a float32
        known = [self.bench.stands(name), memory.stands, memory.answers, rule.safe, self.wishes[name], memory.hand]
        known += [sent.value for sent in (*memory.sent, *memory.late)]
        near = [other for other in known if other is not None]
        # What lies beside a write, or between it and where the point stands, may be what the device makes of it.
        room = 0.1 * (rule.high - rule.low)
        makes = self.bench.unit_of(name).makes.get(name, lambda same: same)
        between = bool(memory.sent) and min(near) <= value <= max(near)
        untold = self.wild or self.anew or between or memory.stands is None or makes(value) != value
        if untold or any(abs(value - other) <= room for other in near):
            return
        self.bench.unit_of(name).set_value(name, value)
        self.hands[name] = Hand(value, self.now)
        self.made.setdefault(name, []).append(value)

    async def quiet_line(self) -> None:
        """Nothing is spoiled for a while; the heart beats in every cycle."""
        self.spoil_none()
        await self.run(self.until_rested())
        beats = len(self.bench.received("heartbeat"))
        await self.run(6)
        assert len(self.bench.received("heartbeat")) == beats + 6, "no heartbeat"
        self.spoil()

    async def a_bus_down(self) -> None:
        """One line is dead; on the other one the heart beats on in every cycle."""
        name = self.random.choice(list(self.bench.proxies))
        self.spoil_none()
        await self.run(self.until_rested())
        dead = self.bench.proxies[name]
        kind = self.random.choice([Fault.NO_REQUEST, Fault.NO_ANSWER, Fault.HANG_UP])
        dead.next_fault = lambda: kind
        beats, cycles = len(self.bench.received("heartbeat")), self.random.choice([2, 5, 20])
        await self.run(cycles)
        if name == "second":
            assert len(self.bench.received("heartbeat")) == beats + cycles, "no heartbeat, though its line is up"
        if self.random.random() < 0.3:
            self.hand()
        self.spoil()

    async def power_up(self) -> None:
        """A unit starts anew: its setpoints hold zeros or what its program sets, its heartbeat register nothing."""
        unit = self.bench.units["plc"]
        if not unit.value("heartbeat"):
            return
        low, self.anew = self.random.choice([0.0, 0.5, 0.9]), True
        for name in unit.points.keys() & RULES.keys():
            unit.set_value(name, low * RULES[name].low)
            self.hands.pop(name, None)
        unit.set_value("heartbeat", 0.0)
        self.bench.proxies["first"].storm = self.random.randrange(3)
        await self.run(self.random.randint(1, 4))

    async def units_that_change_places(self, choice: Random) -> None:
        """Each of the two answers under the other's number for a while."""
        self.spoil_none()
        await self.run(self.until_rested())
        points = self.bench.cycle.readback.points
        if any(memory.sent or memory.stands != self.bench.stands(name) for name, memory in points.items()):
            return
        self.exchange()
        await self.run(1)  # of a sensor that is read before the setpoints nobody can tell whose it is
        if choice.random() < 0.5:
            self.spoil()
        await self.run(choice.choice([0, 3, 20]))
        self.exchange()

    def exchange(self) -> None:
        self.bench.change_places()
        self.exchanged = not self.exchanged
        self.written = self.writes()

    def writes(self) -> int:
        return sum(len(rows) for unit in self.bench.units.values() for rows in unit.received.values())

    async def no_numbers(self) -> None:
        """A sensor's register holds what is no number, and then again what it measures."""
        name = self.random.choice(list(SENSORS))
        unit = self.bench.unit_of(name)
        self.spoiled.add(name)
        unit.set_value(name, self.random.choice([math.nan, math.inf, -math.inf]))
        await self.run(self.random.randint(1, 5))
        unit.set_value(name, SENSORS[name])
        await self.run(1)

    async def a_clock_that_jumps(self) -> None:
        self.bench.clock.ahead = self.random.choice([-56 * YEAR, -1.0 * YEAR, -7200.0, -3.0, 3600.0, YEAR, 10 * YEAR])
        await self.run(self.random.randint(1, 5))
        if self.random.random() < 0.7:
            self.bench.clock.ahead = 0.0

    async def a_disk_that_hangs(self) -> None:
        if self.disk is None:
            return
        self.disk.hang()
        beats, cycles = len(self.bench.received("heartbeat")), self.random.randint(2, 8)
        self.spoil_none()
        await self.run(self.until_rested() + cycles)
        assert len(self.bench.received("heartbeat")) >= beats + cycles, "no heartbeat while the disk hangs"
        self.spoil()
        if self.random.random() < 0.3:
            await self.stop_and_start()
        self.disk.answer()

    async def stop_and_start(self) -> None:
        """Stop in the middle of a cycle or between two, and begin again."""
        during = asyncio.ensure_future(self.bench.cycle.run()) if self.random.random() < 0.5 else None
        if during is not None:
            await asyncio.sleep(self.random.uniform(0.0, 2.0))
        report, took = await self.bench.stop(during)
        self.stopped += 1
        assert took <= STOP_SECONDS + 0.5, f"the stop took {took:.1f} s"
        self.judge_writes(stopping=True)
        named = {*report.failed, *report.unseen, *report.unshown, *report.by_hand, *self.confirmed_only()}
        for name, safe in SAFE.items():
            makes = self.bench.unit_of(name).makes.get(name, lambda same: same)
            stands = self.bench.stands(name)
            assert not report.seen or name in named or stands == makes(safe), (
                f"{name} stands at {stands} after the stop"
            )
        await self.begin_again()

    def confirmed_only(self) -> set[str]:
        """Return the points whose writes are confirmed before they stand there, by a device that may not be seen."""
        return set()

    async def kill(self) -> None:
        """End without a word, in the middle of a cycle."""
        during = asyncio.ensure_future(self.bench.cycle.run())
        await asyncio.sleep(self.random.uniform(0.0, 1.0))
        during.cancel()
        await asyncio.wait((during,))
        self.judge_writes(stopping=False)
        await self.begin_again()

    async def begin_again(self) -> None:
        await asyncio.sleep(self.random.choice([0.5, 3.0, 40.0]))
        self.fall_back_where_nobody_beats()
        if self.random.random() < 0.2:
            self.hand()
        if self.disk is not None:
            self.disk.answer()
        if self.anew and KEPT not in self.bench.notes.content:
            # Both have started anew before the daemon knew the heartbeat's register: values may pass for a hand's.
            for name in self.bench.units["plc"].points.keys() & RULES.keys():
                self.made.setdefault(name, []).append(self.bench.stands(name) or 0.0)
        await self.bench.restart(RESPECT)

    # lines

    def spoil(self) -> None:
        for name, proxy in self.bench.proxies.items():
            proxy.__dict__.pop("next_fault", None)
            proxy.rate = self.rates[name]

    def spoil_none(self) -> None:
        for proxy in self.bench.proxies.values():
            proxy.__dict__.pop("next_fault", None)
            proxy.rate, proxy.storm = 0.0, 0

    def until_rested(self) -> int:
        """Return the cycles until no unit rests any more, and no old answer is awaited."""
        rests = [
            bus.health.rest_left(unit.device_id)
            for bus in self.bench.plc.buses.values()
            if isinstance(bus, ModbusBus)
            for unit in self.bench.map.devices.values()
        ]
        return math.ceil(max(*rests, 20.0) / INTERVAL) + 2

    def kinds(self) -> list[Callable[[], Awaitable[None]]]:
        return [
            self.quiet_line, self.a_bus_down, self.power_up, self.no_numbers, self.a_clock_that_jumps,
            self.a_disk_that_hangs, self.stop_and_start, self.kill,
        ]  # fmt: skip

    async def something(self) -> None:
        if self.random.random() < 0.35:
            self.hand()
            await self.run(self.random.randint(1, 4))
            return
        kind = self.random.choice(self.kinds())
        self.happened.append(kind.__name__)
        await kind()
        await self.run(self.random.choice([0, 1, 4]))

    async def all_is_well_in_the_end(self) -> None:
        """Nothing is spoiled any more: the heart beats, and when hands are over everything stands where it should."""
        self.spoil_none()
        self.bench.clock.ahead = 0.0
        await self.run(self.until_rested() + 12)
        beats = len(self.bench.received("heartbeat"))
        await self.run(5)
        assert len(self.bench.received("heartbeat")) == beats + 5, "no heartbeat in the end"
        if self.wild:
            return
        held = [hand.seconds for hand in self.bench.cycle.readback.hands(self.now).values()]
        await asyncio.sleep(min(max(held, default=0.0), RESPECT))
        await self.run(self.settling)
        for name, wish in self.wishes.items():
            stands, makes = self.bench.stands(name), self.bench.unit_of(name).makes.get(name, lambda same: same)
            assert stands is not None
            assert abs(stands - makes(wish)) <= RULES[name].dead_band + 1e-9, f"{name} stands at {stands}, not {wish}"


async def world_of(seed: int) -> World:
    generator = random.Random(seed)
    rtu, two_buses, wild = bool(seed % 2), bool(seed % 3), seed % 4 == 0
    disk = HangingStore() if generator.random() < 0.25 else None
    source = WildSource(generator) if wild else FixedSource(dict(WISHES))
    bench = await make_plc_bench(
        [source], two_buses=two_buses, rtu=rtu, seed=seed, respect_hand=0.0 if wild else RESPECT,
        store=disk,  # type: ignore[arg-type]  # what the journal needs of it, it has
    )  # fmt: skip
    rates = {name: generator.choice([0.0, 0.05, 0.2, 0.5]) for name in bench.proxies}
    if generator.random() < 0.3:
        bench.units["plc"].makes["co2_setpoint"] = lambda value: min(value, 640.0)
    if generator.random() < 0.3:
        bench.units["plc"].makes["heating_setpoint"] = lambda value: 0.5 * round(value / 0.5)
    for proxy in bench.proxies.values():
        # That a device does what it refuses can be seen; not so when it also makes something else of it.
        proxy.refuses_truly = bool(bench.units["plc"].makes)
    world = World(generator, bench, rates, wild, generator.choice([math.inf, 60.0, 120.0]), disk)
    world.spoil()
    return world


async def play(seed: int, happenings: int = 7, make_world: Callable[[int], Awaitable[World]] = world_of) -> World:
    """Play one sequence; AssertionError for a violation."""
    world = await make_world(seed)
    try:
        await world.run(3)
        for _ in range(happenings):
            await world.something()
        # With a choice of its own, so that all before it is what the seed has always made.
        await world.units_that_change_places(Random(seed))
        await world.all_is_well_in_the_end()
    except AssertionError as error:
        raise AssertionError(f"seed {seed}: {error}; after {', '.join(world.happened)}") from error
    finally:
        if world.disk is not None:
            world.disk.answer()
            world.disk.close()
    await world.bench.close()
    return world


def play_all(seeds: range) -> Iterator[World]:
    for seed in seeds:
        yield run(play(seed))


def judge_all(seeds: range) -> None:
    """Play many; the counts say that something was at stake."""
    seen = hands = stops = 0
    for world in play_all(seeds):
        seen += world.seen
        hands += sum(map(len, world.made.values()))
        stops += world.stopped
    assert seen > 100 * len(seeds)
    assert hands > len(seeds) / 3
    assert stops > len(seeds) / 6


@pytest.mark.usefixtures("quiet")
@pytest.mark.parametrize("start", range(0, 30, 6))
def test_whatever_goes_wrong_between_daemon_and_plc(start: int) -> None:
    judge_all(range(start, start + 6))


@pytest.mark.soak
@pytest.mark.usefixtures("quiet")
@pytest.mark.parametrize("start", range(1000, 11_000, 500))
def test_ten_thousand_fault_sequences_between_daemon_and_plc(start: int) -> None:
    judge_all(range(start, start + 500))
