"""Seeded sequences of hands, faults, restarts and weather on a PLC with a will of its own; the truth is known.

In all of them: no write leaves the limits, nothing is written while somebody operates the PLC, a hand is never lost
(no other value is written to its point while it is respected, but by an interlock) and never invented, no interval is
shortened by a restart; and when all is well again, everything stands where it should.

What no daemon can tell is left out: a hand that sets the very safe value during a silence, one that sets what we have
just written or a value on the way to it, and one that the PLC itself wipes out before anybody has read it.
"""

from __future__ import annotations

import asyncio
import logging
import math
import random
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import pytest

from igrow.edge.bus.errors import UnitRestingError
from igrow.edge.guard import DEFAULT_INTERLOCKS, PointRule
from igrow.edge.guard.answers import takes
from igrow.edge.sensors import default_rule
from tests.control.control_fakes import FixedSource
from tests.control.stubborn_plc import RULES, SAFE, StubbornBench, make_stubborn_bench

RESPECT = 600.0
VENT = PointRule(low=0.0, high=100.0, safe=0.0, dead_band=2.0, minimum_interval=60.0, decided=False)
GOOD = {"air_temperature": 20.0, "air_co2": 600.0, "wind_speed": 3.0, "air_humidity": 70.0}
BAD = (math.nan, math.inf, -math.inf, -999.0, 1e9)
TWO_UNITS = {
    "heating_setpoint": "first", "irrigation_on": "first", "heartbeat": "first", "plc_manual": "first",
    "plc_fallback": "first", "air_temperature": "first", "air_humidity": "first",
    "co2_setpoint": "second", "lamp_on": "second", "vent_lee": "second", "wind_speed": "second", "air_co2": "second",
}  # fmt: skip


@dataclass
class Hand:
    value: float
    at: float
    read: bool = False
    """The daemon has had a chance to see it."""


@dataclass(repr=False)
class World:
    """A bench with what is really so."""

    random: random.Random
    bench: StubbornBench
    wishes: dict[str, float]
    rules: dict[str, PointRule]
    hands: dict[str, Hand] = field(default_factory=dict)
    made: dict[str, list[float]] = field(default_factory=dict)
    written: int = 0
    restored: int = 0

    @property
    def plc(self):
        return self.bench.plc

    @property
    def now(self) -> float:
        return self.bench.clock.monotonic()

    def reachable(self, name: str) -> bool:
        return not self.plc.silent and self.plc.unit_of(name) not in self.plc.down

    # what happens

    async def run(self, cycles: int) -> None:
        for _ in range(cycles):
            self.bench.clock.advance(10.0)
            self.plc.advance(10.0)
            await self.watched(self.bench.cycle.run())

    async def watched(self, doing, *, stopping: bool = False) -> None:
        """Do something of the daemon's, and judge what it writes."""
        self.forget_hands_that_nobody_saw()
        manual = self.plc.values["plc_manual"] >= 0.5 and self.reachable("plc_manual")
        before, rows = len(self.plc.writes), len(self.bench.store.writes)
        await doing
        told = {row.point: row for row in self.bench.store.writes[rows:] if row.outcome in ("written", "failed")}
        for at, name, value in self.plc.writes[before:]:
            if name == "heartbeat":
                continue
            self.written += 1
            rule = self.rules[name]
            assert rule.low <= value <= rule.high
            assert not manual, f"{name} was written while somebody operated the PLC"
            by_interlock = told[name].reason.startswith("interlock")
            self.judge_hand(name, value, by_interlock)
            self.judge_interval(name, at, urgent=by_interlock or stopping)
        self.judge_events()

    def judge_hand(self, name: str, value: float, by_interlock: bool) -> None:
        hand, rule = self.hands.get(name), self.rules[name]
        if hand is None or by_interlock or self.now >= hand.at + RESPECT:
            return
        allowed = min(max(hand.value, rule.low), rule.high)
        assert value == allowed, f"{value} was written to {name}, where a hand had set {hand.value}"
        self.restored += 1

    def judge_interval(self, name: str, at: float, *, urgent: bool) -> None:
        earlier = [when for when, point, _ in self.plc.writes if point == name and when < at]
        if earlier and not urgent:
            assert at - earlier[-1] >= self.rules[name].minimum_interval, f"{name} was written too soon again"

    def judge_events(self) -> None:
        told: dict[str, list[float]] = {}
        for event in self.bench.events("changed_by_hand"):
            told.setdefault(event["point"], []).append(event["shown"])
        for name, values in told.items():
            made = iter(self.made.get(name, []))
            for value in values:
                assert any(abs(value - real) < 1e-9 for real in made), f"a hand at {name} was invented: {value}"

    def forget_hands_that_nobody_saw(self) -> None:
        """A hand that the PLC wiped out before it could be read is no hand for a daemon."""
        for name, hand in list(self.hands.items()):
            if hand.read or not self.reachable(name):
                continue
            if self.plc.values[name] == hand.value:
                hand.read = name not in self.plc.polls
            else:
                del self.hands[name]

    # what may happen

    def hand(self) -> None:
        name = self.random.choice(list(RULES))
        value = self.hand_value(name)
        if value is None:
            return
        self.plc.by_hand(name, value)
        self.hands[name] = Hand(value, self.now)
        self.made.setdefault(name, []).append(value)

    def hand_value(self, name: str) -> float | None:
        """A value that is not by chance what something else would have set."""
        rule, memory = self.rules[name], self.bench.cycle.readback.points[name]
        outside = 0.05 * (rule.high - rule.low) if self.random.random() < 0.2 else 0.0
        value = round(self.random.uniform(rule.low - outside, rule.high + outside), 3)
        stood = [self.plc.values[name], memory.stands, memory.answers, rule.safe, self.wishes[name]]
        stood += [sent.value for sent in (*memory.sent, *memory.late)] + (
            [self.hands[name].value] if name in self.hands else []
        )
        known = [x for x in stood if x is not None]
        # A device's resolution, and a limit of its own, would explain what lies beside or short of a write.
        room = max(2.0 * rule.dead_band, 0.06 * (rule.high - rule.low))
        taken = self.plc.makes.get(name, lambda same: same)(value)
        if value == 0.0 or abs(taken - value) > 0.3 or any(abs(value - x) <= room for x in known):
            return None
        coming = [sent.value for sent in memory.sent]
        if coming and min([*coming, *known]) <= value <= max([*coming, *known]):
            return None
        return value

    def wish(self) -> None:
        name = self.random.choice(list(RULES))
        rule = self.rules[name]
        wish = round(self.random.uniform(rule.low, rule.high), 2)
        if any(takes(rule, wish, stands) for stands in (self.plc.values[name], rule.safe)):
            return  # a write of it that is lost looks like a coarse register's answer
        self.wishes[name] = wish

    def power_up(self) -> None:
        unit = self.random.choice(sorted({self.plc.unit_of(name) for name in RULES}))
        names = [name for name in RULES if self.plc.unit_of(name) == unit]
        has_heartbeat = self.plc.unit_of("heartbeat") == unit
        if has_heartbeat and self.bench.cycle._writer.beats.kept and self.random.random() < 0.5:
            values = {
                name: self.random.choice([0.0, self.rules[name].low, 0.9 * self.rules[name].low]) for name in names
            }
            self.plc.power_up(values)
            return
        # Without a heartbeat register to tell by, it has to look like it, and to be seen at once.
        changed = [name for name in names if self.plc.values[name] > 2.0 * self.rules[name].dead_band]
        if len(changed) >= 2 and changed[0] in ("heating_setpoint", "co2_setpoint") and not self.plc.polls:
            self.plc.power_up(dict.fromkeys(names, 0.0), heartbeat=has_heartbeat and self.random.random() < 0.5)

    async def outage(self) -> None:
        down = self.random.choice([None, *sorted({self.plc.unit_of(name) for name in RULES})])
        self.plc.silent, self.plc.down = down is None, {down} if down is not None else set()
        for _ in range(self.random.randint(1, 3)):
            await self.run(self.random.choice([1, 2, 5, 40]))
            if self.random.random() < 0.3:
                self.hand()
        self.plc.silent, self.plc.down = False, set()

    async def deaf(self) -> None:
        self.plc.write_error = UnitRestingError("the unit rests")
        await self.run(self.random.choice([1, 3, 40]))
        self.plc.write_error = None

    async def restart(self) -> None:
        if self.random.random() < 0.5:
            self.bench.clock.advance(1.0)
            self.plc.advance(1.0)
            await self.watched(self.bench.cycle.stop(), stopping=True)
        away = self.random.choice([1.0, 5.0, 60.0, 500.0, 5000.0])
        self.bench.pass_time(away)
        if self.random.random() < 0.2 and away < RESPECT:
            self.hand()
        self.bench.restart(RESPECT)
        if self.now - self.bench.notes.at > RESPECT:
            self.hands.clear()

    async def by_hand(self) -> None:
        self.plc.values["plc_manual"] = 1.0
        await self.run(self.random.randint(1, 10))
        self.hand()
        await self.run(2)
        self.plc.values["plc_manual"] = 0.0

    async def storm(self) -> None:
        self.plc.values["wind_speed"] = self.random.choice([16.0, 25.0])
        await self.run(self.random.choice([1, 5, 30]))
        self.plc.values["wind_speed"] = GOOD["wind_speed"]

    async def heat(self) -> None:
        self.plc.values["air_temperature"] = 45.0
        await self.run(self.random.choice([1, 5, 30]))
        self.plc.values["air_temperature"] = GOOD["air_temperature"]

    async def bad_readings(self) -> None:
        name = self.random.choice(list(GOOD))
        for _ in range(self.random.choice([1, 1, 2, 5, 20])):
            self.plc.values[name] = self.random.choice(BAD)
            await self.run(1)
        self.plc.values[name] = GOOD[name]

    def date_jumps(self) -> None:
        self.bench.clock.wall = self.random.choice([None, 1.7e9, 0.0, 4e9])

    async def something(self) -> None:
        choices = [self.hand, self.hand, self.hand, self.wish, self.wish, self.power_up, self.outage, self.deaf,
                   self.restart, self.by_hand, self.storm, self.heat, self.bad_readings, self.date_jumps]  # fmt: skip
        done = self.random.choice(choices)()
        if done is not None:
            await done
        await self.run(self.random.choice([1, 1, 2, 8]))

    async def all_is_well_in_the_end(self) -> None:
        await self.run(round(RESPECT / 10.0) + 40)
        for name, wish in self.wishes.items():
            expected = self.plc.makes.get(name, lambda same: same)(wish)
            assert abs(self.plc.values[name] - expected) <= self.rules[name].dead_band + 1e-9, (
                f"{name} stands at {self.plc.values[name]}, wanted {wish}"
            )
        assert self.plc.values["vent_lee"] == 60.0
        assert all(name.startswith("write co2_setpoint") for name in self.bench.alarms), self.bench.alarms


def world_of(seed: int) -> World:
    generator = random.Random(seed)
    rules = {
        name: replace(rule, minimum_interval=generator.choice([0.0, 0.0, 60.0, 300.0])) for name, rule in RULES.items()
    } | {"vent_lee": VENT}
    wishes = {"heating_setpoint": 21.0, "co2_setpoint": 700.0, "lamp_on": 1.0, "irrigation_on": 0.5}
    values = GOOD | {"vent_lee": 60.0, "plc_manual": 0.0}
    if generator.random() < 0.5:
        values["plc_fallback"] = 0.0
    bench = make_stubborn_bench(
        FixedSource(wishes),
        values=values,
        rules=rules,
        decided=tuple(RULES),
        units=TWO_UNITS if generator.random() < 0.5 else {},
        interlocks=DEFAULT_INTERLOCKS,
        sensors={name: replace(default_rule(name, poll_period=10.0), rate=1e9, frozen_after=1e9) for name in GOOD},
        respect_hand=RESPECT,
    )
    plc = bench.plc
    plc.fallback_after = generator.choice([None, 120.0, 300.0])
    if generator.random() < 0.3:
        plc.makes["co2_setpoint"] = lambda value: min(value, 640.0)
    if generator.random() < 0.3:
        plc.makes["heating_setpoint"] = lambda value: 0.5 * round(value / 0.5)
    elif generator.random() < 0.3:
        plc.takes["heating_setpoint"] = generator.choice([5.0, 15.0, 45.0])
    elif generator.random() < 0.3:
        plc.ramps["heating_setpoint"] = generator.choice([0.03, 0.2])
    if generator.random() < 0.2:
        plc.polls = dict.fromkeys(generator.sample(list(RULES), 2), generator.choice([30.0, 60.0]))
    assert wishes.keys() == SAFE.keys()
    return World(generator, bench, wishes, rules)


async def play(seed: int, happenings: int = 8) -> World:
    """Play one sequence; AssertionError for a violation."""
    world = world_of(seed)
    await world.run(3)
    for _ in range(happenings):
        await world.something()
    await world.all_is_well_in_the_end()
    return world


def play_all(seeds: range) -> None:
    """Play many; the counts say that something was at stake."""
    worlds = []
    for seed in seeds:
        try:
            worlds.append(asyncio.run(play(seed)))
        except AssertionError as error:
            raise AssertionError(f"seed {seed}: {error}") from error
    assert sum(world.written for world in worlds) > 8 * len(seeds)
    assert sum(sum(map(len, world.made.values())) for world in worlds) > len(seeds) / 2
    assert sum(world.restored for world in worlds) > len(seeds) / 40


@pytest.fixture
def quiet() -> Iterator[None]:
    """Log nothing: thousands of provoked faults would fill the memory with their warnings."""
    logging.disable(logging.CRITICAL)
    yield
    logging.disable(logging.NOTSET)


@pytest.mark.usefixtures("quiet")
@pytest.mark.parametrize("start", range(0, 80, 20))
def test_hands_are_neither_lost_nor_invented_and_no_write_leaves_the_limits(start: int) -> None:
    play_all(range(start, start + 20))


@pytest.mark.soak
@pytest.mark.usefixtures("quiet")
@pytest.mark.parametrize("start", range(1000, 11_000, 500))
def test_ten_thousand_sequences_of_hands_and_faults(start: int) -> None:
    play_all(range(start, start + 500))
