"""The page beside a running daemon: what is done there takes the road of the command line, and is written down."""

from __future__ import annotations

import asyncio
import re
import urllib.request
from http.cookiejar import CookieJar
from typing import Any
from urllib.parse import urlencode

import pytest

from igrow.edge.page.pages import Pages
from igrow.edge.page.password import hashed, write_password
from igrow.edge.store import read_records
from tests.control.daemon_bench import Plant, free_port, running, until, write_files
from tests.page.page_bench import PASSWORD, served


class Browser:
    """Follows links and fills forms, with its cookies."""

    def __init__(self, port: int) -> None:
        self._url = f"http://localhost:{port}"
        self._opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor(CookieJar()))

    def look(self) -> str:
        return self._read(self._url)

    def fill(self, path: str, **fields: str) -> str:
        token = re.search(r'name="token" value="([^"]*)"', self.look())
        form = fields | ({"token": token[1]} if token else {})
        return self._read(self._url + path, urlencode(form).encode())

    def _read(self, url: str, form: bytes | None = None) -> str:
        with self._opener.open(url, form, timeout=60) as answer:
            return str(answer.read().decode())


@pytest.fixture
def greenhouse(tmp_path):
    """The files of a greenhouse in New Zealand, 13 h ahead of UTC in its summer."""
    port = free_port()
    path = write_files(tmp_path, port)
    site = tmp_path / "site.yaml"
    site.write_text(site.read_text() + "time_zone: Pacific/Auckland\n")
    return path, port


async def test_the_growers_word_reaches_the_plc_and_the_ledger_with_his_name(greenhouse, tmp_path):
    path, port = greenhouse
    plant = Plant(tmp_path, port, start="2026-03-01T00:00:00")
    await plant.up()

    def events(kind: str) -> list[Any]:
        found = [record.body for record in read_records(tmp_path / "state" / "store", "event")]
        return [body["detail"] for body in found if body["kind"] == kind]

    async with running(path) as daemon:
        await until(lambda: daemon.cycles >= 2)
        write_password(tmp_path / "state", hashed(PASSWORD))
        with served(Pages(path)) as server:
            browser = Browser(server.port)
            page = await asyncio.to_thread(browser.look)
            assert "Sunday, 1 March 2026, 1" in page
            await asyncio.to_thread(browser.fill, "/sign-in", who="Anna", password=PASSWORD)
            wish = {"do": "override", "setpoint": "heating_setpoint", "value": "16.5", "hours": "48"}
            page = await asyncio.to_thread(lambda: browser.fill("/act", **wish))
            assert "16.5 °C by hand for 2 days" in page
            await until(lambda: plant.shows("heating_setpoint") == 16.5)
            await until(lambda: events("overridden"))
            assert events("overridden")[0] | {"seconds": 0} == {
                "setpoint": "heating_setpoint", "value": 16.5, "seconds": 0, "by": "Anna (page)",
            }  # fmt: skip
            await asyncio.to_thread(lambda: browser.fill("/act", do="release", setpoint="heating_setpoint"))
            await until(lambda: events("given_back") == [{"setpoint": "heating_setpoint", "by": "Anna (page)"}])
            await until(lambda: plant.shows("heating_setpoint") == 19.0)
            await asyncio.to_thread(lambda: browser.fill("/act", do="recipe", hours="48"))
            await until(lambda: events("recipe_wanted"))
            await asyncio.to_thread(lambda: browser.fill("/act", do="plan"))
            await until(lambda: events("plans_wanted") == [{"by": "Anna (page)"}])
            plant.table.values["wind_speed"] = 99.0
            await until(lambda: any(one.name == "sensor wind_speed" for one in daemon._journal.alarms.active))
            await asyncio.sleep(2.5)  # an answer of the daemon serves for two seconds
            await asyncio.to_thread(lambda: browser.fill("/act", do="acknowledge", alarm="sensor wind_speed"))
            await until(lambda: events("acknowledged") == [{"alarm": "sensor wind_speed", "by": "Anna (page)"}])
    await plant.down()


async def test_a_daemon_that_stops_is_not_taken_for_one_that_runs(greenhouse, tmp_path):
    path, port = greenhouse
    plant = Plant(tmp_path, port)
    await plant.up()
    async with running(path) as daemon:
        await until(lambda: daemon.cycles >= 2)
    await plant.down()
    with served(Pages(path)) as server:
        page = await asyncio.to_thread(Browser(server.port).look)
    assert "The controller is not heard" in page
    assert "the last that is known" in page
