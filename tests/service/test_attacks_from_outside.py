"""The daemon as a process, attacked as strangers would: by its PLC, by signals and by who edits its files."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from igrow.edge.registers.codec import encode
from igrow.edge.registers.model import Function
from igrow.edge.virtual_plc.memory import AnswerWithExceptionError
from tests.service.attacked_daemon import MAP, SAFE, SITE, WISH, AttackedDaemon

READ_ONLY, DEVICE_FAILURE, ACKNOWLEDGED, BUSY = 2, 4, 5, 6
NO_PATH = 10
LONG_SILENCE = 6.0
"""Seconds: more than three cycles, after which a PLC may have fallen back."""


@pytest.fixture
def attacked(tmp_path: Path) -> Iterator[AttackedDaemon]:
    daemon = AttackedDaemon(tmp_path)
    yield daemon
    daemon.close()


def cycles(daemon: AttackedDaemon, more: int) -> None:
    before = daemon.status().get("cycle", 0)
    daemon.until(lambda: daemon.status().get("cycle", 0) >= before + more)


def alarms(daemon: AttackedDaemon) -> list[str]:
    return [alarm["text"] for alarm in daemon.status().get("alarms", [])]


@pytest.mark.parametrize("code", [BUSY, NO_PATH])
def test_a_plc_that_refuses_only_writes_and_falls_back_is_controlled_again(attacked: AttackedDaemon, code: int) -> None:
    """It answers what is read all the time, so nothing is silent."""
    attacked.start()
    attacked.controls()
    attacked.beats(3)
    attacked.plc.refuses["write"] = code
    time.sleep(LONG_SILENCE)
    attacked.until(lambda: any("heartbeat" in text for text in alarms(attacked)))
    with attacked.plc.lock:
        attacked.plc.set_value("co2_setpoint", SAFE["co2_setpoint"])  # its own fallback
    cycles(attacked, 3)
    attacked.plc.refuses.clear()
    attacked.controls()
    attacked.beats(2)
    assert "by hand at the PLC" not in attacked.log()


def test_a_stop_at_a_plc_whose_registers_have_become_read_only_says_what_the_plc_said(attacked: AttackedDaemon) -> None:
    attacked.start()
    attacked.controls()
    attacked.beats(3)
    attacked.plc.refuses["write"] = READ_ONLY
    attacked.signal(signal.SIGTERM)
    assert attacked.ended() == 0
    said = attacked.log().rsplit("stopped:", 1)[1]
    assert "nothing was written" in said and "refused with exception 2" in said
    assert "does not answer" not in said


@pytest.mark.parametrize("code", [DEVICE_FAILURE, ACKNOWLEDGED, BUSY])
def test_a_plc_that_answers_everything_with_an_exception_for_a_while_is_controlled_again(
    attacked: AttackedDaemon, code: int
) -> None:
    attacked.start()
    attacked.controls()
    attacked.beats(3)
    attacked.plc.refuses.update({"read": code, "write": code})
    time.sleep(LONG_SILENCE)
    with attacked.plc.lock:
        attacked.plc.set_value("co2_setpoint", SAFE["co2_setpoint"])  # its own fallback
        attacked.plc.refuses.clear()
    attacked.controls()
    attacked.beats(2)
    assert "by hand at the PLC" not in attacked.log()


def test_a_number_of_which_only_one_word_was_taken_ends_where_it_is_wanted(attacked: AttackedDaemon) -> None:
    """The PLC starts anew between the two words of one write, again and again."""
    torn: list[float] = []

    def one_word_only(name: str, value: float) -> None:
        if name == "co2_setpoint" and len(torn) < 3:
            torn.append(value)
            point = attacked.plc.points[name]
            attacked.plc.tables[point.function].put(point.address + 1, [encode(point, value)[1]])
            raise AnswerWithExceptionError(DEVICE_FAILURE)

    attacked.plc.before_write = one_word_only
    attacked.start()
    attacked.controls()
    attacked.beats(2)
    assert len(torn) == 3
    assert "by hand at the PLC" not in attacked.log()


def test_a_plc_whose_words_are_turned_gets_nothing_from_the_running_daemon(attacked: AttackedDaemon) -> None:
    def turned(function: Function, address: int, words: list[int]) -> list[int]:
        end = {Function.INPUT: 8, Function.HOLDING: 4}[function] - address
        return [words[place ^ 1] if place < end else word for place, word in enumerate(words)]

    attacked.start()
    attacked.controls()
    attacked.beats(3)
    with attacked.plc.lock:
        attacked.plc.after_read = turned
        before = len(attacked.plc.received)
    attacked.until(lambda: any("make no sense" in text for text in alarms(attacked)))
    cycles(attacked, 5)
    assert len(attacked.plc.received) <= before + 1, "the cycle that was under way may end"
    attacked.signal(signal.SIGTERM)
    assert attacked.ended() == 0
    assert len(attacked.plc.received) <= before + 1
    assert "make no sense" in attacked.log().rsplit("stopped:", 1)[1]
    assert "by hand at the PLC" not in attacked.log()


def test_a_reload_and_several_stops_at_once_end_with_the_safe_setpoints(attacked: AttackedDaemon) -> None:
    attacked.start()
    attacked.controls()
    cycles(attacked, 1)
    for number in (signal.SIGHUP, signal.SIGTERM, signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        attacked.signal(number)
    assert attacked.ended() == 0
    assert {name: attacked.plc.shows(name) for name in SAFE} == SAFE


def test_a_stop_before_the_plc_has_answered_ends_at_once(attacked: AttackedDaemon) -> None:
    attacked.plc.refuses["read"] = NO_PATH
    attacked.start()
    attacked.until(lambda: "started" in attacked.log())
    attacked.signal(signal.SIGTERM)
    assert attacked.ended() == 0
    assert attacked.plc.received == []
    assert "its own safe setpoints rule" in attacked.log()


def test_reloads_that_change_limits_and_address_or_make_no_sense(attacked: AttackedDaemon) -> None:
    """A faulty file, a map that is gone, a port where nobody listens, and back; then a limit below what stands."""
    attacked.start()
    attacked.controls()
    cycles(attacked, 1)
    attacked.configuration.write_text("site: [")
    attacked.signal(signal.SIGHUP)
    attacked.until(lambda: attacked.log().count("the last good configuration stays in force") == 1)
    attacked.write_files("127.0.0.1", attacked.port)
    (attacked.folder / "map.yaml").unlink()
    attacked.signal(signal.SIGHUP)
    attacked.until(lambda: attacked.log().count("the last good configuration stays in force") == 2)
    attacked.beats(2)
    attacked.write_files("127.0.0.1", 9)
    attacked.signal(signal.SIGHUP)
    attacked.until(lambda: any("no point of the PLC can be read" in text for text in alarms(attacked)))
    attacked.write_files("127.0.0.1", attacked.port)
    attacked.signal(signal.SIGHUP)
    attacked.beats(4)
    assert {name: attacked.plc.shows(name) for name in WISH} == WISH
    (attacked.folder / "site.yaml").write_text(SITE.replace("low: 400, high: 1000", "low: 400, high: 600"))
    attacked.signal(signal.SIGHUP)
    attacked.until(lambda: attacked.plc.shows("co2_setpoint") == 600.0)
    assert "by hand at the PLC" not in attacked.log()


def test_a_reload_that_swaps_two_addresses_writes_nothing_under_the_old_meaning(attacked: AttackedDaemon) -> None:
    """The PLC's program was changed together with the map."""
    attacked.start()
    attacked.controls()
    cycles(attacked, 1)
    first, second = "function: holding, address: 0,", "function: holding, address: 2,"
    text = MAP.replace(first, "FIRST").replace(second, first).replace("FIRST", second)
    (attacked.folder / "map.yaml").write_text(text.format(host="127.0.0.1", port=attacked.port))
    with attacked.plc.lock:
        heating, co2 = (attacked.plc.tables[Function.HOLDING].content[place : place + 2] for place in (0, 2))
        before = len(attacked.plc.received)
        attacked.signal(signal.SIGSTOP)
        attacked.plc.tables[Function.HOLDING].put(0, [*co2, *heating])
    attacked.signal(signal.SIGHUP)
    attacked.signal(signal.SIGCONT)
    attacked.until(lambda: "read again" in attacked.log())
    attacked.beats(4)
    # By the new map register 0 holds the CO2 setpoint: the test's PLC names it by the old one.
    for name, value in attacked.plc.written(before):
        low, high = (400.0, 1000.0) if name == "heating_setpoint" else (12.0, 28.0)
        assert low <= value <= high, f"{value} to the register of the other setpoint"


def test_a_hand_at_a_setpoint_that_one_reload_leaves_out_and_the_next_brings_back_is_respected(
    attacked: AttackedDaemon,
) -> None:
    """Somebody takes the setpoint's lines out of the files, and puts them in again."""

    def reload(*, with_co2: bool) -> None:
        for path, text in whole.items():
            lines = text.replace(", co2_setpoint]", "]").splitlines(keepends=True)
            less = "".join(line for line in lines if "co2_setpoint" not in line)
            path.write_text(text if with_co2 else less)
        times = attacked.log().count("was read again")
        attacked.signal(signal.SIGHUP)
        attacked.until(lambda: attacked.log().count("was read again") > times)
        attacked.beats(4)

    attacked.start()
    attacked.controls()
    attacked.beats(3)
    whole = {path: path.read_text() for path in attacked.folder.glob("*.yaml")}
    with attacked.plc.lock:
        attacked.plc.set_value("co2_setpoint", 555.0)
    attacked.until(lambda: "by hand at the PLC" in attacked.log())
    reload(with_co2=False)
    reload(with_co2=False)
    reload(with_co2=True)
    assert attacked.plc.shows("co2_setpoint") == 555.0


def test_a_plc_that_hangs_with_its_line_open_is_controlled_again(attacked: AttackedDaemon) -> None:
    attacked.start()
    attacked.controls()
    attacked.beats(3)
    with attacked.plc.lock:
        time.sleep(LONG_SILENCE + 4.0)
        attacked.plc.set_value("co2_setpoint", SAFE["co2_setpoint"])
    attacked.controls()
    attacked.beats(2)
    assert "by hand at the PLC" not in attacked.log()
