"""What a sceptical engineer does to a gateway: a second one on the same PLC, and files that are not what they were."""

import asyncio
import threading

import pytest

from igrow.core.errors import IgrowError
from igrow.edge import reloading
from igrow.edge.configuration import Configuration, load_configuration
from igrow.edge.hand_off import HandOff
from igrow.edge.reloading import Reloading
from igrow.edge.sources import GrowerOverride
from igrow.edge.sources.override import Lease, write_leases
from igrow.edge.state_file import StateFile
from tests.control.control_fakes import FixedSource, image_of
from tests.control.daemon_bench import until, write_files
from tests.control.stubborn_plc import make_stubborn_bench

WISH = {"heating_setpoint": 21.0, "co2_setpoint": 700.0, "lamp_on": 1.0, "irrigation_on": 0.5}


def bench_of(**more):
    return make_stubborn_bench(FixedSource(dict(WISH)), **more)


async def test_two_gateways_on_one_plc_are_told_and_do_not_fight():
    """Each has its own state folder, so that no lock keeps them apart."""
    ours, theirs = bench_of(), make_stubborn_bench(FixedSource(WISH | {"heating_setpoint": 24.0}))
    theirs.plc.values = ours.plc.values
    written = []
    for _ in range(30):
        await ours.run(1)
        await theirs.run(1)
        written.append(len(ours.plc.written("heating_setpoint")) + len(theirs.plc.written("heating_setpoint")))
    # Where both happen to count the same number, one of them cannot tell.
    told = [gateway.alarms.get("heartbeat register", "") for gateway in (ours, theirs)]
    assert any("another gateway" in text for text in told)
    assert written[-1] == written[9]
    await ours.run(3)
    assert "heartbeat register" not in ours.alarms


async def test_a_plc_that_never_keeps_the_heartbeat_is_no_second_gateway():
    bench = bench_of()
    bench.plc.ignores = {"heartbeat"}
    await bench.run(20)
    assert not bench.alarms


async def test_a_reload_that_is_asked_for_while_one_is_under_way_is_not_lost(tmp_path, monkeypatch):
    path, go_on, read = write_files(tmp_path, 5020, heating=19.0), threading.Event(), []

    def slowly(asked):
        configuration = load_configuration(asked)
        read.append(configuration)
        if len(read) == 1:
            go_on.wait()
        return configuration

    monkeypatch.setattr(reloading, "load_configuration", slowly)
    one = Reloading(path)
    assert one.start()
    await until(lambda: read)
    write_files(tmp_path, 5020, heating=20.0)
    assert not one.start()
    go_on.set()
    taken: list[Configuration] = []
    while len(taken) < 2:
        found = one.take()
        taken += [found] if found is not None else []
        await asyncio.sleep(0.01)
    assert [found.file.recipe.heating_setpoint[0].value for found in taken] == [19.0, 20.0]
    await asyncio.sleep(0.05)
    assert one.take() is None
    one.close()


@pytest.mark.parametrize("way", ["unreadable", "half written"])
def test_an_override_that_cannot_be_read_goes_on_and_is_told(tmp_path, way):
    path = tmp_path / "override.json"
    override = GrowerOverride(StateFile(path, HandOff("state files")))
    assert write_leases(path, {"heating_setpoint": Lease(16.0, 3600.0)}) == ""
    assert override.offer(image_of(0.0)).setpoints == {"heating_setpoint": 16.0}
    path.unlink()
    if way == "unreadable":
        path.mkdir()  # root, who may run these tests, reads any file
    else:
        path.write_text('{"heating_setpoint": {"val')
    assert override.offer(image_of(10.0)).setpoints == {"heating_setpoint": 16.0}
    assert "override.json cannot be read" in override.problem
    assert override.offer(image_of(3700.0)).setpoints == {}
    if way == "unreadable":
        path.rmdir()
    assert write_leases(path, {"heating_setpoint": Lease(17.0, 3600.0)}) == ""
    assert override.offer(image_of(3710.0)).setpoints == {"heating_setpoint": 17.0}
    assert override.problem == ""


def test_an_override_that_is_taken_away_is_given_back(tmp_path):
    path = tmp_path / "override.json"
    override = GrowerOverride(StateFile(path, HandOff("state files")))
    write_leases(path, {"heating_setpoint": Lease(16.0, 3600.0)})
    assert override.offer(image_of(0.0)).setpoints == {"heating_setpoint": 16.0}
    path.unlink()
    assert override.offer(image_of(10.0)).setpoints == {}
    assert override.problem == ""


@pytest.mark.parametrize("file", ["daemon.yaml", "site.yaml", "map.yaml"])
def test_a_file_that_an_editor_has_half_written_is_read_or_refused_in_one_line(tmp_path, file):
    path = write_files(tmp_path, 5020)
    whole = (tmp_path / file).read_bytes()
    refused = 0
    for length in range(0, len(whole), max(1, len(whole) // 40)):
        (tmp_path / file).write_bytes(whole[:length])
        try:
            load_configuration(path)
        except IgrowError as error:
            refused += 1
            assert file in str(error) or "yaml" in str(error)
    assert refused > 10
