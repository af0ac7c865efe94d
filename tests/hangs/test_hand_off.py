"""Work that is handed over: done once, in its order; nobody waits longer than agreed, and no exit waits at all."""

from __future__ import annotations

import asyncio
import gc
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Future
from functools import partial

import pytest

from igrow.edge.hand_off import HandOff, LateError, settled
from tests.control.daemon_bench import until
from tests.patience import PATIENCE as SOON


class Latch:
    """Work that hangs until it is let go."""

    def __init__(self) -> None:
        self.begun, self.go_on = threading.Event(), threading.Event()

    def __call__(self) -> str:
        self.begun.set()
        self.go_on.wait()
        return "late"


@pytest.fixture
def latch() -> Iterator[Latch]:
    one = Latch()
    yield one
    one.go_on.set()


def wait_until_done(aside: HandOff) -> None:
    aside.post(lambda: None).result(SOON)


def test_work_is_done_in_its_order_and_its_result_or_error_comes_back() -> None:
    aside = HandOff("work")
    done: list[int] = []
    for number in range(100):
        aside.post(partial(done.append, number))
    assert aside.do(lambda: "result") == "result"
    assert done == list(range(100))
    with pytest.raises(ZeroDivisionError):
        aside.do(lambda: 1 / 0)
    assert aside.do(lambda: "the thread lives") == "the thread lives"


@pytest.mark.parametrize("error", [SystemExit, KeyboardInterrupt, TimeoutError, asyncio.CancelledError])
def test_an_error_of_whatever_kind_ends_the_work_and_not_the_thread(error: type[BaseException]) -> None:
    aside = HandOff("work")

    def failing() -> None:
        raise error

    with pytest.raises(error):
        aside.do(failing)
    assert aside.do(lambda: 1) == 1
    assert aside.waiting == 0


def test_posts_from_many_threads_are_each_done_once_and_in_the_order_of_their_thread() -> None:
    aside = HandOff("work")
    done: list[tuple[int, int]] = []

    def post(thread: int) -> None:
        for number in range(500):
            aside.post(partial(done.append, (thread, number)))

    threads = [threading.Thread(target=post, args=(thread,)) for thread in range(8)]
    for one in threads:
        one.start()
    for one in threads:
        one.join()
    assert aside.close(SOON)
    assert len(done) == 8 * 500
    assert all([number for at, number in done if at == thread] == list(range(500)) for thread in range(8))


def test_who_hears_that_work_is_done_may_hand_over_more_at_once() -> None:
    aside, heard = HandOff("work"), threading.Event()
    seen = []

    def again(_: object) -> None:
        seen.append(aside.waiting)
        aside.post(heard.set)

    aside.post(lambda: None).add_done_callback(again)
    assert heard.wait(SOON)
    assert seen[0] <= 1


def test_who_waits_for_work_that_hangs_gets_on_and_the_work_is_done_later(latch: Latch) -> None:
    aside, done = HandOff("work", patience=0.05), []
    with pytest.raises(LateError, match="work: not done within"):
        aside.do(latch)
    with pytest.raises(LateError):
        aside.do(lambda: done.append("later"))
    assert done == []
    latch.go_on.set()
    wait_until_done(aside)
    assert done == ["later"]


def test_work_that_would_be_pointless_later_is_not_handed_over_behind_work_that_is_late(latch: Latch) -> None:
    now = [0.0]
    aside, done = HandOff("work", patience=0.01, monotonic=lambda: now[0]), []
    aside.post(latch)
    assert latch.begun.wait(SOON)
    now[0] = 1.0
    with pytest.raises(LateError, match="an earlier piece of work"):
        aside.ask(lambda: done.append("pointless"))
    latch.go_on.set()
    wait_until_done(aside)
    assert done == []


def test_waits_that_are_short_each_do_not_add_up(latch: Latch, monkeypatch: pytest.MonkeyPatch) -> None:
    """What bounds one wait bounds the sum as well: a share of the time is all that is ever spent."""
    now, waited = [0.0], [0.0]

    def never(future: Future[object], timeout: float) -> object:
        now[0] += timeout
        waited[0] += timeout
        raise TimeoutError

    monkeypatch.setattr(Future, "result", never)
    aside = HandOff("work", patience=0.2, share=0.1, monotonic=lambda: now[0])
    aside.post(latch)
    for _ in range(200):
        now[0] += 0.01
        with pytest.raises(LateError):
            aside.do(lambda: None)
    assert 0.2 <= waited[0] <= 0.2 + 0.1 * now[0]


def test_a_full_queue_refuses_and_says_so(latch: Latch) -> None:
    now = [0.0]
    aside = HandOff("the log", longest_queue=3, monotonic=lambda: now[0])
    aside.post(latch)
    assert latch.begun.wait(SOON)
    for _ in range(3):
        aside.post(lambda: None)
    for _ in range(2):
        with pytest.raises(LateError, match="3 pieces of work wait"):
            aside.post(lambda: None)
    assert aside.problem == ""
    now[0] = 60.0
    assert aside.problem == (
        "the log: no answer for 60 s from a disk or a share; 3 pieces of work wait, 2 could not wait"
    )
    latch.go_on.set()
    assert aside.close(SOON)
    assert aside.problem == ""


def test_a_close_waits_for_what_was_handed_over_and_takes_nothing_more() -> None:
    aside = HandOff("work")
    done: list[int] = []
    for number in range(20):
        aside.post(partial(time.sleep, 0.001))
        aside.post(partial(done.append, number))
    assert aside.close(SOON)
    assert done == list(range(20))
    with pytest.raises(LateError):
        aside.post(lambda: None)
    assert aside.close(0.0)


def test_a_close_leaves_behind_what_hangs(latch: Latch) -> None:
    aside = HandOff("work")
    aside.post(latch)
    begin = time.monotonic()
    assert not aside.close(0.05)
    assert time.monotonic() - begin < SOON
    latch.go_on.set()
    assert aside.close(SOON)


def test_one_that_was_never_used_is_closed_at_once() -> None:
    assert HandOff("work").close(0.0)


async def test_the_event_loop_goes_on_while_work_hangs_and_a_second_attempt_is_refused(latch: Latch) -> None:
    aside = HandOff("bus line")
    first = asyncio.ensure_future(aside.run(latch))
    await until(latch.begun.is_set)
    with pytest.raises(LateError, match="an earlier attempt hangs"):
        await aside.run(lambda: None)
    latch.go_on.set()
    assert await asyncio.wait_for(first, SOON) == "late"


async def test_what_comes_after_nobody_waits_any_more_is_undone(latch: Latch) -> None:
    aside, undone = HandOff("bus line"), threading.Event()
    attempt = asyncio.ensure_future(aside.run(latch, undo=lambda result: undone.set() if result == "late" else None))
    await until(latch.begun.is_set)
    attempt.cancel()
    with pytest.raises(asyncio.CancelledError):
        await attempt
    assert not undone.is_set()
    latch.go_on.set()
    assert undone.wait(SOON)


async def test_an_error_that_comes_after_nobody_waits_any_more_harms_nobody(latch: Latch, caplog) -> None:
    aside = HandOff("bus line")

    def failing() -> None:
        latch()
        raise OSError("too late")

    attempt = asyncio.ensure_future(aside.run(failing))
    await until(latch.begun.is_set)
    attempt.cancel()
    with pytest.raises(asyncio.CancelledError):
        await attempt
    del attempt
    latch.go_on.set()
    wait_until_done(aside)
    await asyncio.sleep(0.01)
    gc.collect()
    assert not caplog.records


async def test_waiting_for_a_while_ends_with_the_work_or_with_the_while(latch: Latch) -> None:
    aside = HandOff("work")
    begin = time.monotonic()
    await settled(aside.post(lambda: None), SOON)
    assert time.monotonic() - begin < SOON
    future = aside.post(latch)
    await settled(future, 0.05)
    assert not future.done()


HANGS_AT_THE_END = """
import threading
from igrow.edge.hand_off import HandOff
aside = HandOff("work")
aside.post(threading.Event().wait)
aside.post(lambda: None)
print("the end", flush=True)
"""


def test_no_exit_of_the_interpreter_waits_for_work_that_hangs() -> None:
    done = subprocess.run(
        [sys.executable, "-c", HANGS_AT_THE_END], capture_output=True, text=True, timeout=120, check=True
    )
    assert done.stdout == "the end\n"
    assert done.stderr == ""
