"""Seeded sequences of cut connections, full disks, repeated and reordered deliveries, clocks and kills at any instant;
and of memories that go back: a side restored from its backup, a second trainer, a site that gets another name.

After each sequence the faults end, gateway and trainer make their rounds, and the archive must hold every row and every
record once. A kill is an exception that nothing catches, raised before or after any one operation on a disk or on the
exchange, on either side; everything in memory is then thrown away.
"""

from __future__ import annotations

import random
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path

import pytest

from igrow.core.errors import IgrowError
from igrow.core.exchange import Entry, ExchangeError, FolderPlace
from igrow.edge.exchange import outbox
from igrow.trainer.service import archive, ledger
from igrow.trainer.service.archive import Archive
from igrow.trainer.service.collecting import collect
from tests.exchange.gateway_and_trainer import DAY, START, World

QUICK, SOAK = 25, 600
DAYS = 5
STEPS = [*("round", "collect", "repeat") * 4, "second trainer", "renamed", "trainer", "gateway"]


class Killed(BaseException):
    """The process is gone."""


class Chance:
    """What goes wrong, drawn from a seed."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.healed = False
        self.rate = self.random.choice([0.02, 0.1, 0.3])

    def hits(self, rate: float | None = None) -> bool:
        return not self.healed and self.random.random() < (self.rate if rate is None else rate)

    def around(self, work: Callable[[], object], error: Callable[[], BaseException]) -> object:
        """Do the work; it may fail, or its process be killed, before it or after it."""
        if self.hits():
            raise self.random.choice([Killed, error])()
        result = work()
        if self.hits():
            raise self.random.choice([Killed, error])()  # it was done, and nobody was told
        return result


class BadPlace(FolderPlace):
    """An exchange whose connection is cut, which shows cut files, repeats deliveries and lists only a part."""

    def __init__(self, root: Path, chance: Chance) -> None:
        super().__init__(root)
        self.chance = chance
        self.sent: dict[str, bytes] = {}

    def _cut(self) -> ExchangeError:
        return ExchangeError("the connection was cut")

    def entries(self, folder: str) -> list[Entry]:
        found = self.chance.around(lambda: super(BadPlace, self).entries(folder), self._cut)
        assert isinstance(found, list)
        if self.chance.hits(0.3) and folder.endswith("segments"):
            found = [entry for entry in found if self.chance.random.random() < 0.5]
        return found

    def get(self, path: str, largest: int) -> bytes | None:
        if self.chance.hits(0.05) and "/receipts/" in path:
            return (super().get(path, largest) or b"")[: self.chance.random.randrange(100)]
        return self.chance.around(lambda: super(BadPlace, self).get(path, largest), self._cut)  # type: ignore[return-value]

    def put(self, path: str, content: bytes) -> None:
        if self.chance.hits(0.05) and "/segments/" in path:
            super().put(path, content[: self.chance.random.randrange(len(content))])
            raise self._cut()
        self.chance.around(lambda: super(BadPlace, self).put(path, content), self._cut)
        if "/segments/" in path:
            self.sent[path] = content

    def delete(self, path: str) -> None:
        self.chance.around(lambda: super(BadPlace, self).delete(path), self._cut)

    def repeat(self) -> None:
        """Deliver again something that was delivered before."""
        for path in self.chance.random.sample(sorted(self.sent), min(2, len(self.sent))):
            super().put(path, self.sent[path])


@contextmanager
def bad_disks(patch: pytest.MonkeyPatch, chance: Chance) -> Iterator[None]:
    """Make the disks of both sides full now and then, and kill whoever writes to them."""
    for module in (outbox, archive, ledger):
        write = module.write_whole

        def write_or_not(path: Path, content: bytes, write=write) -> None:
            chance.around(lambda: write(path, content), lambda: OSError(28, "No space left on device"))

        patch.setattr(module, "write_whole", write_or_not)
    yield
    patch.undo()


class Backups:
    """Copies of what one side remembers, which come back in its place when it has moved on."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.sides = {"trainer": world.archive.root, "gateway": world.outbox}

    def turn(self, side: str) -> None:
        """Make a copy where there is none, else restore it."""
        present = self.sides[side]
        copy = self.world.folder / f"{side}-backup"
        if copy.exists():
            shutil.rmtree(present, ignore_errors=True)
            copy.rename(present)
        elif present.exists():
            shutil.copytree(present, copy)


def log_with_jumps(world: World, chance: Chance, now: float, later: float) -> None:
    """Let the gateway measure for some hours; its clock may go back for a part of one, seen by no round."""
    world.log(now, later, 3600)
    if chance.hits(0.2):
        begin = now - chance.random.choice([5, 30, 60]) * 3600 + chance.random.randrange(1, 3000)
        end = begin + chance.random.choice([600, 3000])
        world.log(begin, end, 300)
        low, high = world.seen or (begin, end)
        world.seen = (min(low, begin), max(high, end))


def run_sequence(folder: Path, seed: int, patch: pytest.MonkeyPatch) -> None:
    chance = Chance(seed)
    place = BadPlace(folder / "exchange", chance)
    world = World(folder, place, period=chance.random.choice([DAY, DAY // 4]))
    backups = Backups(world)
    with bad_disks(patch, chance):
        now = START
        while now < START + DAYS * DAY:
            later = now + chance.random.choice([6, 12, 24, 30]) * 3600
            log_with_jumps(world, chance, now, later)
            now = later
            for _ in range(chance.random.randrange(1, 4)):
                clock = now + 300 if not chance.hits(0.1) else now + chance.random.choice([-400, 3653]) * DAY
                step = chance.random.choice(STEPS)
                try:
                    if step == "round":
                        world.round(clock, partly=chance.random.random() < 0.2)
                    elif step == "collect":
                        world.collect(now + 2 * DAY)
                    elif step == "second trainer":
                        second = Archive(folder / "second")
                        collect(place, world.site, second, datetime.fromtimestamp(now + 2 * DAY, UTC))
                    elif step == "renamed":
                        world.site = f"greenhouse-{chance.random.randrange(100)}"
                    elif step in backups.sides:
                        backups.turn(step)
                    else:
                        place.repeat()
                except (Killed, IgrowError, OSError):
                    continue
        chance.healed = True
        for _ in range(5):
            now += DAY
            world.log(now, now + 3600, 3600)
            assert world.round(now + DAY + 300).problem == ""
            world.collect(now + DAY, take_over=True)
        assert world.round(now + DAY + 900).waiting == 0
        assert place.entries(f"{world.site}/segments") == []
        notes = world.collect(now + 2 * DAY).notes
    assert notes == []
    world.assert_complete()
    world.store.close()


@pytest.mark.parametrize("seed", range(QUICK))
def test_nothing_is_lost_and_nothing_is_there_twice(seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run_sequence(tmp_path, seed, monkeypatch)


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(1000, 1000 + SOAK))
def test_nothing_is_lost_and_nothing_is_there_twice_in_long(
    seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run_sequence(tmp_path, seed, monkeypatch)
