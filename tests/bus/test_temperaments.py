"""Seeded sequences of faults on devices with temperaments, judged as those of `test_daemon_fault_sequences` are.

What no daemon can tell is left out: a hand that a PLC or a gateway wipes out before a reading shows it, and one in the
same reading as a start, or as one of the first clearings of a heartbeat's register by a PLC that watches it so.
"""

from __future__ import annotations

import math
import random
from collections.abc import Awaitable, Callable, Iterator
from dataclasses import dataclass, field

import pytest

from igrow.edge.guard.answers import takes
from igrow.edge.guard.heartbeat import HABIT, LATE_BEATS
from tests.bus.plc_bench import INTERVAL, RULES, make_plc_bench
from tests.bus.simulated_loop import run
from tests.bus.temperaments import MoodyUnit
from tests.bus.test_daemon_fault_sequences import RESPECT, WISHES, World, play
from tests.control.control_fakes import FixedSource

BUSY = 6
NO_ANSWER_BEHIND_THE_GATEWAY = 11
GRID = 0.0625
"""Exact in a float32."""


@dataclass(repr=False)
class MoodyWorld(World):
    """A world whose devices have temperaments."""

    saved: list[tuple[float, dict[str, float]]] = field(default_factory=list)
    """When a PLC has put which registers away."""
    anew_at: float = -math.inf

    @property
    def unit(self) -> MoodyUnit:
        unit = self.bench.units["plc"]
        assert isinstance(unit, MoodyUnit)
        return unit

    @property
    def setpoints(self) -> list[str]:
        return sorted(self.unit.points.keys() & RULES.keys())

    @property
    def lag(self) -> float:
        """Seconds by which a reading may be old, and what a hand needs to be seen."""
        return self.unit.shows_every or 0.0

    async def cycle(self) -> None:
        await super().cycle()
        self.anew |= self.now - self.anew_at < self.lag + 2 * INTERVAL
        content = {name: self.unit.value(name) or 0.0 for name in (*self.setpoints, "heartbeat")}
        self.saved = [*self.saved[-60:], (self.now, content)]

    def judge_hand(self, name: str, at: float, value: float, *, stopping: bool) -> None:
        hand = self.hands.get(name)
        fresh = hand is not None and not hand.known and at - hand.at < self.lag + 2 * INTERVAL
        if fresh and self.lag and name in self.setpoints:
            del self.hands[name]  # nobody could see it yet
            return
        super().judge_hand(name, at, value, stopping=stopping)

    def hand(self) -> None:
        watched = self.unit.clears_heartbeat_every is not None
        if watched and self.bench.cycle._writer.beats._idle <= HABIT:
            return
        if self.unit.frozen or self.unit.refuses is not None:
            return
        super().hand()

    def confirmed_only(self) -> set[str]:
        late = self.unit.takes_at is not None or self.unit.ramps or self.unit.deaf_for
        return set(RULES) if late and any(proxy.rate for proxy in self.bench.proxies.values()) else set()

    def begins_anew(self, values: dict[str, float]) -> None:
        self.anew, self.anew_at = True, self.now
        for name, value in values.items():
            self.unit.set_value(name, value)
            self.hands.pop(name, None)

    # what happens

    async def power_up(self) -> None:
        self.anew_at = self.now
        if not self.lag:  # a beat would stand over the sign of it before the gateway looks
            await super().power_up()

    async def wish(self) -> None:
        """A source wants something else."""
        name = self.random.choice(list(RULES))
        rule = RULES[name]
        wish = round(self.random.uniform(rule.low, rule.high) / GRID) * GRID
        if takes(rule, wish, self.bench.stands(name) or 0.0):
            return  # a write of it that is lost looks like a coarse register's answer
        self.wishes[name] = wish
        await self.run(self.random.choice([0, 1, 4]))

    async def local_mode(self) -> None:
        """Somebody has switched the PLC to local: it takes no setpoint."""
        self.unit.is_local = True
        await self.run(self.random.choice([1, 5, 30]))
        if self.random.random() < 0.5:
            self.hand()
            await self.run(4)
        self.unit.is_local = False

    async def busy(self) -> None:
        """Or a gateway that does not find it."""
        self.unit.refuses = self.random.choice([BUSY, NO_ANSWER_BEHIND_THE_GATEWAY])
        await self.run(self.random.choice([1, 5, 40]))
        self.unit.refuses = None

    async def reboot_between_two_writes(self) -> None:
        """The PLC loses its power after one of the writes of a cycle; it is away for a while."""
        if not self.unit.value("heartbeat") or not self.bench.cycle._writer.beats.kept or self.lag:
            return
        left, low = self.random.randint(1, 4), self.random.choice([0.0, 0.5, 0.9])

        def counted(name: str) -> None:
            nonlocal left
            left -= 1
            if left == 0:
                self.unit.at_write = lambda name: None
                self.unit.refuses = NO_ANSWER_BEHIND_THE_GATEWAY
                self.begins_anew({name: low * RULES[name].low for name in self.setpoints} | {"heartbeat": 0.0})
                self.unit.loop.call_later(self.random.uniform(2.0, 20.0), back)

        def back() -> None:
            self.unit.refuses = None

        self.unit.at_write = counted
        for name in self.setpoints:
            self.wishes[name] = RULES[name].low + self.random.randint(1, 15) / 16 * (RULES[name].high - RULES[name].low)
        await self.run(8)
        self.unit.at_write, self.unit.refuses = (lambda name: None), None

    def kept_earlier(self) -> dict[str, float] | None:
        """What the PLC has put away half a minute ago or earlier; None where its heartbeat would say nothing."""
        beats = self.bench.cycle._writer.beats
        earlier = [content for at, content in self.saved if self.now - at > 30.0 + self.lag]
        watched = self.unit.clears_heartbeat_every is not None
        if not earlier or not beats._kept or watched or self.lag:  # it would be overwritten before anybody reads it
            return None
        content = self.random.choice(earlier)
        number = content["heartbeat"]
        return content if number and number not in beats._ours and number != beats._shown else None

    async def restart_with_what_it_kept(self) -> None:
        """The PLC starts anew with the registers of some minutes ago, its heartbeat among them."""
        content = self.kept_earlier()
        if content is None:
            return
        self.unit.refuses = NO_ANSWER_BEHIND_THE_GATEWAY
        await self.run(self.random.randint(1, 2))
        self.begins_anew(content)
        self.unit.refuses = None
        await self.run(2)

    async def start_in_two_steps(self) -> None:
        """Its registers are zero first; what it has kept comes later."""
        content = self.kept_earlier()
        if content is None:
            return
        self.spoil_none()
        await self.run(self.until_rested())
        if not self.bench.cycle._writer.beats._kept:
            return
        self.begins_anew(dict.fromkeys(content, 0.0))
        await self.run(self.random.randint(1, 3))
        self.begins_anew(content)
        await self.run(3)
        self.spoil()

    async def panel_that_writes_what_we_wish(self) -> None:
        name = self.random.choice(self.setpoints)
        if self.bench.stands(name) == self.wishes[name] or name in self.hands:
            return
        self.unit.set_value(name, self.wishes[name])
        self.made.setdefault(name, []).append(self.wishes[name])
        await self.run(2)

    async def programme_of_its_own(self) -> None:
        """The PLC sets all its setpoints to those of its own day: like hands, all at once."""
        for _ in range(6):
            self.hand()
        await self.run(2)

    async def gateway_that_answers_for_it(self) -> None:
        self.spoil_none()
        await self.run(self.until_rested())
        self.unit.freeze()
        await self.run(self.random.choice([2, 8, 14, 40]))
        if self.random.random() < 0.3 and self.bench.cycle._writer.beats.kept:
            await self.run(LATE_BEATS + 4)
            assert "answer for a PLC" in self.bench.cycle._writer.beats.problem
        self.unit.frozen = False
        await self.run(self.until_rested())
        self.spoil()

    def kinds(self) -> list[Callable[[], Awaitable[None]]]:
        return [
            *super().kinds(), self.wish, self.wish, self.local_mode, self.busy, self.reboot_between_two_writes,
            self.restart_with_what_it_kept, self.start_in_two_steps, self.panel_that_writes_what_we_wish,
            self.programme_of_its_own, self.gateway_that_answers_for_it,
        ]  # fmt: skip


def temper(world: MoodyWorld, rng: random.Random) -> None:
    """Give the units one to three temperaments."""
    unit, other = world.unit, world.bench.units["other"]
    assert isinstance(other, MoodyUnit)

    def by_direction(value: float) -> float:
        stands = unit.value("heating_setpoint") or 0.0
        if value == stands:
            return value
        return 0.5 * (math.floor(value / 0.5) if value > stands else math.ceil(value / 0.5))

    def ramps() -> None:
        unit.ramps["heating_setpoint"] = rng.choice([0.1, 0.5])

    def at_the_minute() -> None:
        unit.takes_at = rng.choice([30.0, 60.0])

    def lags() -> None:
        unit.shows_every = rng.choice([7.0, 10.0, 12.0])

    def clears() -> None:
        unit.clears_heartbeat_every = rng.choice([20.0, 60.0])

    def ends_early() -> None:
        unit.highest_beat = 32_767.0
        unit.set_value("heartbeat", 32_740.0)

    def is_deaf() -> None:
        unit.deaf_for = dict.fromkeys(RULES, rng.choice([3.0, 20.0]))

    def hangs_up() -> None:
        for proxy in world.bench.proxies.values():
            proxy.most_requests = rng.choice([1, 5, 20])

    def quantises() -> None:
        unit.makes["heating_setpoint"] = by_direction

    kinds = [ramps, at_the_minute, lags, clears, ends_early, is_deaf, hangs_up, quantises]
    chosen = rng.sample(kinds, rng.randint(1, 2))
    while {ramps, clears} <= set(chosen):  # of the first clearings, one in a ramp looks like a start on the way
        chosen = rng.sample(kinds, 2)
    for temperament in chosen:
        temperament()
        world.happened.append(temperament.__name__)


async def moody_world_of(seed: int) -> MoodyWorld:
    rng = random.Random(seed)
    wishes = dict(WISHES)
    bench = await make_plc_bench(
        [FixedSource(wishes)], two_buses=bool(seed % 3), rtu=bool(seed % 2), seed=seed, respect_hand=RESPECT,
        unit=MoodyUnit,
    )  # fmt: skip
    rates = {name: rng.choice([0.0, 0.0, 0.05, 0.2]) for name in bench.proxies}
    world = MoodyWorld(rng, bench, rates, False, rng.choice([math.inf, 60.0, 120.0]), None, wishes, settling=60)
    temper(world, rng)
    for proxy in bench.proxies.values():
        # What is refused and done all the same can be seen, but not where a device also does it in its own time.
        proxy.refuses_truly = bool(world.unit.makes or world.unit.ramps or world.unit.takes_at)
    world.spoil()
    return world


def play_all(seeds: range) -> Iterator[World]:
    for seed in seeds:
        yield run(play(seed, make_world=moody_world_of))


def judge_all(seeds: range) -> None:
    worlds = list(play_all(seeds))
    assert sum(world.seen for world in worlds) > 100 * len(seeds)
    assert sum(sum(map(len, world.made.values())) for world in worlds) > len(seeds) / 4


@pytest.mark.usefixtures("quiet")
@pytest.mark.parametrize("start", range(0, 40, 8))
def test_whatever_temperament_a_device_has(start: int) -> None:
    judge_all(range(start, start + 8))


@pytest.mark.soak
@pytest.mark.usefixtures("quiet")
@pytest.mark.parametrize("start", range(1000, 6000, 500))
def test_five_thousand_sequences_on_devices_with_temperaments(start: int) -> None:
    judge_all(range(start, start + 500))
