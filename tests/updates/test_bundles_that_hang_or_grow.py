"""Bundles that are signed and bad: they cost the daemon nothing, are refused, and are tried once."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from igrow.edge.planning import GraphProcess, ProcessLimits
from igrow.edge.updates import UpdateRules, bundles, life
from igrow.edge.updates.state import UpdateState, load_state, save_state
from igrow.trainer.publishing import publish
from tests.patience import PATIENCE
from tests.tiny_bundle import endless_graph, greedy_graph, write_tiny_bundle
from tests.updates.update_helpers import Gateway, wait_for

RULES = UpdateRules(check_hours=1.0, shadow_hours=30.0, watch_hours=48.0, live_error_hours=6.0)


@pytest.fixture
def gateway(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("igrow.trainer.publishing.repository.self_test", lambda bundle: ())
    graphs = GraphProcess(ProcessLimits(memory_bytes=2**29))
    made = Gateway(tmp_path, RULES, graphs=graphs)
    yield made
    graphs.close()
    made.stop()


def send(gateway: Gateway, graph: bytes | None = None, offset: float = 5.0):
    made = write_tiny_bundle(gateway.folder / f"made-{time.monotonic_ns()}", offset=offset, graph=graph)
    return publish(made.folder, gateway.exchange_root, gateway.keys)


def memory_of(pid: int) -> int:
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def test_a_bundle_that_needs_all_memory_is_refused_and_the_daemon_grows_by_nothing(gateway: Gateway) -> None:
    bad = send(gateway, greedy_graph(3))
    before, largest, over = memory_of(os.getpid()), [0], threading.Event()

    def watch() -> None:
        while not over.wait(0.01):
            largest[0] = max(largest[0], memory_of(os.getpid()))

    threading.Thread(target=watch, daemon=True).start()
    gateway.run(0.5)
    over.set()
    assert largest[0] - before < 100 * 2**20
    assert bad.identity in gateway.described()["rejected"]
    assert gateway.kinds().count("bundle_rejected") == 1
    gateway.run(3.0)
    assert gateway.kinds().count("bundle_rejected") == 1
    good = send(gateway)
    gateway.run(2.0)
    assert gateway.active.name == good.label


def test_a_bundle_whose_self_test_never_ends_is_ended_and_refused(
    gateway: Gateway, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bundles, "TAKE_SECONDS", 8.0)
    bad = send(gateway, endless_graph())
    gateway.run(0.2)
    assert "took too long" in gateway.described()["rejected"][bad.identity]
    monkeypatch.setattr(bundles, "TAKE_SECONDS", PATIENCE)
    good = send(gateway)
    gateway.run(2.0)
    assert gateway.active.name == good.label


def test_a_stop_waits_for_no_self_test_and_holds_nothing_against_the_bundle(gateway: Gateway) -> None:
    send(gateway, endless_graph())
    gateway.updates.tick(gateway.now)
    assert isinstance(gateway.graphs, GraphProcess)
    while gateway.graphs.pid is None or load_state(gateway.folder / "updates" / "state.json").attempt is None:
        time.sleep(0.01)
    gateway.graphs.close()
    gateway.stop()
    assert not gateway.updates.busy
    state = load_state(gateway.folder / "updates" / "state.json")
    assert (state.attempt, state.rejected) == (None, {})


def test_a_bundle_that_took_the_gateway_down_is_not_tried_again_and_the_trainer_hears_of_it(gateway: Gateway) -> None:
    """Killed in the middle of its self-test, as by a machine that has run out of memory."""
    bad = send(gateway, endless_graph())
    gateway.stop()
    script = gateway.folder / "gateway.py"
    script.write_text(
        "import sys, time\n"
        f"sys.path.insert(0, {str(Path(__file__).parents[2])!r})\n"
        "from pathlib import Path\n"
        "from tests.updates.update_helpers import Gateway\n"
        "from tests.updates.test_bundles_that_hang_or_grow import RULES, GraphProcess\n"
        f"gateway = Gateway(Path({str(gateway.folder)!r}), RULES, graphs=GraphProcess())\n"
        "gateway.updates.tick(gateway.now)\n"
        "time.sleep(600)\n"
    )
    daemon = subprocess.Popen([sys.executable, str(script)])
    state_file = gateway.folder / "updates" / "state.json"
    until = time.monotonic() + PATIENCE
    while load_state(state_file).attempt is None:
        assert time.monotonic() < until
        time.sleep(0.05)
    daemon.send_signal(signal.SIGKILL)
    daemon.wait()
    gateway.start()
    gateway.run(3.0)
    assert gateway.described()["rejected"] == {bad.identity: bundles.WENT_DOWN}
    assert gateway.kinds().count("bundle_rejected") == 1
    (report,) = (gateway.folder / "transfer" / "reports").iterdir()
    assert json.loads(report.read_text())["reason"] == bundles.WENT_DOWN
    assert load_state(state_file).attempt is None


def test_a_first_bundle_that_took_the_gateway_down_is_not_tried_again(gateway: Gateway) -> None:
    first = write_tiny_bundle(gateway.folder / "first", offset=4.0)
    gateway.stop()
    save_state(gateway.folder / "updates" / "state.json", UpdateState(attempt=first.identity))
    gateway.start(first_bundle=first.folder)
    assert gateway.updates.active() is None
    assert bundles.WENT_DOWN in gateway.described()["refusal"]


def test_a_first_bundle_that_the_disk_does_not_take_comes_into_force_once_it_does(gateway: Gateway) -> None:
    gateway.stop()
    first = write_tiny_bundle(gateway.folder / "first", offset=4.0)
    shelf = gateway.folder / "updates" / "bundles"
    shutil.rmtree(shelf, ignore_errors=True)
    shelf.write_text("a file")
    gateway.start(first_bundle=first.folder)
    gateway.run(0.5)
    assert gateway.updates.active() is None
    assert str(shelf) in gateway.updates.health
    shelf.unlink()
    gateway.run(2.0)
    assert gateway.active.name == first.label
    assert (gateway.updates.health, gateway.described()["refusal"]) == ("", "")
    assert gateway.kinds().count("update_failed") == 1


class Killer:
    """Kills the process for graphs each time that it starts, as a kernel does whose memory is short."""

    def __init__(self, graphs: GraphProcess) -> None:
        self.killed: set[int] = set()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._kill, args=(graphs,), daemon=True)

    def _kill(self, graphs: GraphProcess) -> None:
        while not self._over.wait(0.002):
            if (pid := graphs.pid) is not None:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
                self.killed.add(pid)

    def __enter__(self) -> Killer:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()


def test_a_process_that_is_killed_again_and_again_is_held_against_no_bundle(gateway: Gateway) -> None:
    """Neither the first one, a candidate at its self-test or after its shadow run, nor one on probation."""
    assert isinstance(gateway.graphs, GraphProcess)
    gateway.stop()
    with Killer(gateway.graphs) as killer:
        gateway.start(first_bundle=write_tiny_bundle(gateway.folder / "first", offset=4.0).folder)
        gateway.run(1.0)
        assert 2 <= len(killer.killed) <= 4, "each pause is twice as long as the one before"
        assert "was killed (signal 9): is memory short?" in gateway.updates.health
    gateway.run(3.0)
    first = gateway.updates.active()
    assert first is not None
    assert gateway.updates.health == ""
    candidate = send(gateway)
    with Killer(gateway.graphs):
        gateway.run(2.0)
    gateway.run(4.0)
    assert gateway.described()["candidate"] == candidate.label
    gateway.run(25.0)
    with Killer(gateway.graphs):
        gateway.run(6.0)
    gateway.run(12.0)
    assert gateway.active.name == candidate.label
    with Killer(gateway.graphs):
        gateway.run(26.0)
    gateway.run(60.0)
    assert gateway.active.name == candidate.label
    assert gateway.described()["rejected"] == {}
    assert gateway.described()["probation_until"] is None
    assert gateway.kinds().count("update_failed") == 4, "once each time that it begins"


def test_a_candidate_that_took_the_gateway_down_in_its_shadow_run_gives_way(gateway: Gateway) -> None:
    gateway.stop()
    gateway.start(first_bundle=write_tiny_bundle(gateway.folder / "first", offset=4.0).folder)
    first = gateway.updates.active()
    candidate = send(gateway)
    gateway.run(2.0)
    assert gateway.described()["candidate"] == candidate.label
    gateway.stop()
    state_file = gateway.folder / "updates" / "state.json"
    state = load_state(state_file)
    state.attempt = candidate.identity
    save_state(state_file, state)
    gateway.start()
    gateway.run(1.0)
    description = gateway.updates.describe()
    assert description["candidate"] is None
    assert description["rejected"] == {candidate.identity: bundles.WENT_DOWN}
    assert gateway.updates.active() == first


def test_a_disk_that_fills_up_during_a_trial_is_not_held_against_the_bundle(
    gateway: Gateway, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No room, and no inode, for another file: the bundle could not be unpacked, and the note of its trial stays."""
    saved: list[str | None] = []

    def once(path: Path, state: UpdateState) -> None:
        if saved:
            raise OSError(28, "No space left on device")
        saved.append(state.attempt)
        save_state(path, state)

    good = send(gateway)
    with monkeypatch.context() as full:
        full.setattr(bundles, "save_state", once)
        gateway.run(0.2)
        assert saved == [good.identity]
        gateway.stop()
    state = load_state(gateway.folder / "updates" / "state.json")
    assert state.attempt is None
    gateway.start()
    gateway.run(2.0)
    assert gateway.described()["rejected"] == {}
    assert gateway.active.name == good.label


def test_a_trial_that_cannot_be_noted_is_not_made(gateway: Gateway, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    send(gateway)
    monkeypatch.setattr(bundles, "save_state", full)
    gateway.run(0.5)
    assert gateway.updates.active() is None
    assert "a trial cannot be noted: No space left on device" in gateway.described()["refusal"]
    assert gateway.described()["rejected"] == {}


class HangingPredictor:
    """A bundle whose prediction never ends, told by its offset."""

    def predict(self, bundle, log, origins, steps):
        time.sleep(600)


def test_a_candidate_whose_prediction_never_ends_is_rejected(gateway: Gateway, monkeypatch: pytest.MonkeyPatch) -> None:
    gateway.stop()
    gateway.start(first_bundle=write_tiny_bundle(gateway.folder / "first", offset=4.0).folder)
    first = gateway.updates.active()
    gateway.run(30.0)
    candidate = send(gateway)
    gateway.run(29.0)
    monkeypatch.setattr(life, "JUDGE_SECONDS", 5.0)
    gateway.updates._life._predictor = HangingPredictor()
    gateway.run(4.0)
    assert "cannot predict: it took too long" in gateway.described()["rejected"][candidate.identity]
    assert gateway.updates.active() == first
    wait_for(gateway.updates)


@pytest.mark.parametrize("years", [10, -1])
def test_a_clock_that_was_wrong_for_a_moment_holds_no_bundle_up_for_ever(gateway: Gateway, years: int) -> None:
    gateway.stop()
    gateway.start(first_bundle=write_tiny_bundle(gateway.folder / "first", offset=4.0).folder)
    gateway.run(2.0)
    right, gateway.now = gateway.now, gateway.now + years * 365 * 86_400.0
    gateway.run(0.5, measured=False)
    gateway.now = right
    better = send(gateway)
    gateway.run(2.0)
    gateway.now, right = gateway.now + years * 365 * 86_400.0, gateway.now
    gateway.run(0.5, measured=False)
    gateway.now = right
    gateway.run(34.0)
    assert gateway.active.name == better.label
    gateway.now, right = gateway.now + years * 365 * 86_400.0, gateway.now
    gateway.run(0.5, measured=False)
    gateway.now = right
    gateway.run(52.0)
    assert gateway.described()["probation_until"] is None
    assert gateway.active.name == better.label
