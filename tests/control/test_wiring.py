"""The parts get what the configuration says."""

import json
import socket

from igrow.edge.configuration import load_configuration
from igrow.edge.services import open_services
from igrow.edge.status import StatusServer
from tests.control.daemon_bench import Plant, free_port, running, until, write_files


async def test_a_status_port_that_is_taken_is_told_where_the_state_is_left(tmp_path):
    port = free_port()
    path = write_files(tmp_path, port)
    plant = Plant(tmp_path, port)
    await plant.up()
    with socket.create_server(("127.0.0.1", 0)) as taken:
        number = taken.getsockname()[1]
        path.write_text(path.read_text().replace("port: 0", f"port: {number}"))
        async with running(path) as daemon:
            await until(lambda: daemon.cycles >= 2)
    await plant.down()
    state = json.loads((tmp_path / "state" / "status.json").read_text())["state"]
    assert any(problem.startswith(f"status page: port {number} on localhost") for problem in state["problems"])


def test_health_is_lost_after_three_intervals_without_a_cycle(tmp_path):
    services = open_services(load_configuration(write_files(tmp_path, 5020, interval="5 min")))
    services.close()
    assert isinstance(services.status, StatusServer)
    assert services.status._late_after == 900.0
