"""The daemon as a process whose PLC is called by a name, while name servers do what they do on a bad day."""

from __future__ import annotations

import json
import os
import signal
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.service.attacked_daemon import MAP, SAFE, AttackedDaemon
from tests.service.running_daemon import ROOT

RESOLVER = '''
"""A resolver that answers what a file says, in the place of the system's."""
import json, pathlib, socket, time

names, look_up = pathlib.Path(__file__).with_name("names.json"), socket.getaddrinfo

def answer(host, port, *arguments, **named):
    if host != "plc.example":
        return look_up(host, port, *arguments, **named)
    said = json.loads(names.read_text())
    time.sleep(said["seconds"])
    if not said["addresses"]:
        raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")
    return [found for one in said["addresses"] for found in look_up(one, port, *arguments, **named)]

socket.getaddrinfo = answer
'''
FOR_EVER = 86_400.0


class NamedPlc(AttackedDaemon):
    """A daemon whose map calls the PLC plc.example."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, host="plc.example")
        (folder / "sitecustomize.py").write_text(RESOLVER)
        self.resolver("127.0.0.1")

    def resolver(self, *addresses: str, seconds: float = 0.0) -> None:
        """Let name servers answer so, after so many seconds; without an address the name is unknown."""
        partial = self.folder / "names.part"
        partial.write_text(json.dumps({"addresses": addresses, "seconds": seconds}))
        partial.replace(self.folder / "names.json")

    def start(self, **environment: str) -> None:
        super().start(PYTHONPATH=os.pathsep.join((str(self.folder), str(ROOT))), **environment)

    def line_comes_back(self, address: str = "127.0.0.1") -> None:
        """Let the PLC hang up on everybody, and listen again."""
        before = self.log().count("was lost")
        self.do(self.server.close())
        self.until(lambda: self.log().count("was lost") > before)
        self.do(self.server.listen(address, self.port))

    def stops_well(self) -> None:
        self.signal(signal.SIGTERM)
        assert self.ended() == 0
        assert {name: self.plc.shows(name) for name in SAFE} == SAFE


@pytest.fixture
def named(tmp_path: Path) -> Iterator[NamedPlc]:
    daemon = NamedPlc(tmp_path)
    yield daemon
    daemon.close()


@pytest.fixture
def swallowing(named: NamedPlc) -> Iterator[str]:
    """Return an address of this machine that neither takes nor refuses a connection at the PLC's port."""
    line = [socket.create_server(("127.0.0.2", named.port), backlog=0)]
    for _ in range(4):  # more than its queue holds: the kernel drops what comes after
        line.append(socket.socket())
        line[-1].setblocking(False)
        line[-1].connect_ex(("127.0.0.2", named.port))
    yield "127.0.0.2"
    for one in line:
        one.close()


def test_a_name_server_slower_than_the_bus_costs_a_start_its_time_and_not_the_plc(named: NamedPlc) -> None:
    """As where the first of two name servers is gone: each answer comes after 5 s, and the bus waits for 1 s."""
    named.resolver("127.0.0.1", seconds=5.0)
    named.start()
    named.until(lambda: "no name server has said yet where plc.example is" in named.log())
    named.controls()
    named.beats(3)
    named.stops_well()


@pytest.mark.parametrize("gone", [{"seconds": FOR_EVER}, {"seconds": 0.0}], ids=["silent", "unknown"])
def test_a_line_that_is_lost_while_nobody_knows_its_name_comes_back(named: NamedPlc, gone: dict[str, float]) -> None:
    named.start()
    named.controls()
    named.resolver(**gone)
    named.beats(2)
    named.line_comes_back()
    named.beats(3)
    named.line_comes_back()
    named.beats(3)
    named.stops_well()


def test_a_stop_whose_line_is_lost_while_no_name_server_answers_writes_the_safe_setpoints(named: NamedPlc) -> None:
    named.start()
    named.controls()
    named.resolver(seconds=FOR_EVER)
    named.line_comes_back()
    named.stops_well()


def test_of_two_addresses_of_which_one_swallows_everything_the_other_is_used(named: NamedPlc, swallowing: str) -> None:
    """As with an IPv6 address in the name server of which the network carries nothing."""
    named.resolver(swallowing, "127.0.0.1")
    named.start()
    named.controls()
    named.beats(3)
    named.stops_well()


def test_a_plc_that_has_moved_is_found_at_its_new_address(named: NamedPlc) -> None:
    named.start()
    named.controls()
    named.resolver("127.0.0.3")
    named.line_comes_back("127.0.0.3")
    named.beats(3)
    named.stops_well()


def test_reloads_that_open_the_lines_anew_leave_no_thread_behind(named: NamedPlc) -> None:
    def threads() -> int:
        assert named.process is not None
        return len(list(Path(f"/proc/{named.process.pid}/task").iterdir()))

    named.start()
    named.controls()
    first = 0
    for times in range(1, 9):
        text = MAP.replace("timeout: 1 s", f"timeout: {times + 1} s")
        (named.folder / "map.yaml").write_text(text.format(host="plc.example", port=named.port))
        named.signal(signal.SIGHUP)
        named.until(lambda times=times: named.log().count("was read again") == times)  # type: ignore[misc]
        named.beats(2)
        first = first or threads()
    named.until(lambda: threads() <= first + 1)
    named.stops_well()
