"""A number of two words, read while its PLC was setting it: one word is the old one's, the other the new one's."""

from __future__ import annotations

import asyncio
import random
from collections.abc import Sequence

import pytest

from igrow.edge.registers.model import Function
from tests.bus.plc_bench import INTERVAL, RULES, RecordingUnit, make_plc_bench
from tests.bus.simulated_loop import run
from tests.control.control_fakes import FixedSource


class TornUnit(RecordingUnit):
    """The first reading after each write shows one word of what stood there before."""

    first = 0
    torn = 0

    def write(self, function: Function, address: int, values: Sequence[int]) -> None:
        before = self.tables[function].read(address, len(values))
        super().write(function, address, values)
        self.before = {**getattr(self, "before", {}), (function, address): before}

    def read(self, function: Function, address: int, count: int) -> list[int]:
        words = list(super().read(function, address, count))
        for (table, first), before in list(getattr(self, "before", {}).items()):
            if table is function and len(before) == 2 and address <= first and first + 2 <= address + count:
                del self.before[table, first]
                words[first - address + self.first] = before[self.first]
                type(self).torn += 1
        return words


@pytest.mark.parametrize("word", [0, 1])
def test_a_number_that_was_read_while_it_was_being_set_is_no_hand(word: int) -> None:
    TornUnit.first, TornUnit.torn = word, 0

    async def played(seed: int) -> list[str]:
        generator = random.Random(seed)
        wishes: dict[str, float] = {}
        bench = await make_plc_bench([FixedSource(wishes)], respect_hand=600.0, unit=TornUnit)
        for number in range(40):
            if number % 4 == 0:
                wishes |= {name: generator.uniform(rule.low, rule.high) for name, rule in RULES.items()}
            await bench.cycle.run()
            await asyncio.sleep(INTERVAL)
        await bench.close()
        return bench.store.kinds()

    for seed in range(10):
        assert set(run(played(seed))) == {"source"}
    assert TornUnit.torn > 200


def test_a_hand_is_told_in_the_cycle_in_which_it_is_seen() -> None:
    """The second look takes no other cycle."""

    async def played() -> None:
        bench = await make_plc_bench([FixedSource({"heating_setpoint": 21.0})], respect_hand=600.0)
        for _ in range(4):
            await bench.cycle.run()
            await asyncio.sleep(INTERVAL)
        bench.units["plc"].set_value("heating_setpoint", 15.5)
        await bench.cycle.run()
        assert "changed_by_hand" in bench.store.kinds()
        await bench.close()

    run(played())
