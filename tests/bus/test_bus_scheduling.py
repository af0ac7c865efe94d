"""Whose turn it is, how long to wait, who rests: with clocks that are passed in."""

from __future__ import annotations

import asyncio

import pytest

from igrow.edge.bus.errors import NotConnectedError, QueueFullError
from igrow.edge.bus.pacing import Pacer
from igrow.edge.bus.protocol import Priority
from igrow.edge.bus.request_slot import RequestSlot
from igrow.edge.bus.unit_health import HealthBook
from tests.bus.simulated_loop import run


class FakeClock:
    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


async def served_in_order(priorities: list[Priority], longest_queue: int = 64) -> list[Priority | str]:
    slot = RequestSlot(longest_queue)
    served: list[Priority | str] = []

    async def job(priority: Priority) -> None:
        try:
            await slot.acquire(priority)
            served.append(priority)
            await asyncio.sleep(0.001)
            slot.release()
        except QueueFullError:
            served.append(f"{priority.name} refused")

    await slot.acquire(Priority.LOG)
    jobs = [asyncio.ensure_future(job(priority)) for priority in priorities]
    await asyncio.sleep(0.001)
    slot.release()
    await asyncio.gather(*jobs)
    return served


def test_a_write_goes_before_the_heartbeat_before_control_before_the_log() -> None:
    order = [Priority.LOG, Priority.CONTROL, Priority.WRITE, Priority.HEARTBEAT, Priority.CONTROL]
    assert run(served_in_order(order)) == sorted(order)


def test_a_full_queue_refuses_the_least_urgent() -> None:
    order = [Priority.LOG, Priority.CONTROL, Priority.LOG, Priority.WRITE]
    expected = ["LOG refused", "LOG refused", Priority.WRITE, Priority.CONTROL]
    assert run(served_in_order(order, longest_queue=2)) == expected


def test_a_cancelled_waiter_neither_blocks_nor_keeps_the_slot() -> None:
    async def main() -> int:
        slot = RequestSlot()
        await slot.acquire(Priority.LOG)
        waiters = [asyncio.ensure_future(slot.acquire(Priority.WRITE)) for _ in range(3)]
        await asyncio.sleep(0)
        waiters[0].cancel()
        slot.release()  # hands over to the second
        waiters[1].cancel()  # in the same instant: it must hand over to the third
        await asyncio.gather(*waiters, return_exceptions=True)
        assert waiters[2].exception() is None
        slot.release()
        await asyncio.wait_for(slot.acquire(Priority.LOG), 1)
        return slot.waiting

    assert run(main()) == 0


def test_closing_fails_those_who_wait_and_those_who_come() -> None:
    async def main() -> None:
        slot = RequestSlot()
        await slot.acquire(Priority.LOG)
        waiter = asyncio.ensure_future(slot.acquire(Priority.WRITE))
        await asyncio.sleep(0)
        slot.close()
        for attempt in (waiter, slot.acquire(Priority.WRITE)):
            with pytest.raises(NotConnectedError):
                await attempt

    run(main())


def test_the_bus_gap_holds_for_every_unit_and_a_units_own_gap_for_it_alone() -> None:
    clock = FakeClock()
    pacer = Pacer(clock, 0.03, {2: 0.5})
    assert pacer.wait(1) == 0.0
    pacer.finished(2)
    assert pacer.wait(1) == pytest.approx(0.03)
    assert pacer.wait(2) == pytest.approx(0.5)
    clock.now += 0.1
    assert pacer.wait(1) == 0.0
    assert pacer.wait(2) == pytest.approx(0.4)


def test_a_unit_rests_two_seconds_more_for_each_failure_after_the_first_up_to_five_minutes() -> None:
    clock = FakeClock()
    book = HealthBook(clock)
    rests = []
    for _ in range(4):
        book.failed(1, silent=True)
        rests.append(book.rest_left(1))
    assert rests == pytest.approx([0.0, 2.0, 4.0, 6.0])
    for _ in range(1000):
        book.failed(1, silent=True)
    assert book.rest_left(1) == pytest.approx(300.0)
    assert book.rest_left(2) == 0.0


def test_one_answer_ends_the_rest() -> None:
    book = HealthBook(FakeClock())
    for _ in range(5):
        book.failed(1, silent=False)
    book.answered(1)
    assert book.rest_left(1) == 0.0
    assert (book.unit(1).bad_answers, book.unit(1).failures) == (5, 0)
