"""The weather comes from a server, from the last days, or from the date; a bad answer changes nothing."""

from __future__ import annotations

import http.server
import json
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from urllib.parse import parse_qs, urlparse

import numpy as np
import pytest

from igrow.core.errors import IgrowError
from igrow.core.planner.season import SeasonPlan
from igrow.edge.planning import fetch as fetching
from igrow.edge.planning.fetch import address, fetch
from igrow.edge.planning.make_plan import _without_forecast
from igrow.edge.planning.open_meteo import read_forecast
from tests.planning.test_open_meteo import content
from tests.planning.test_plan_from_bundle import SITE, START, log


class Server(http.server.BaseHTTPRequestHandler):
    """Answers with what the class holds."""

    status, body = 200, b""
    asked = ""

    def do_GET(self) -> None:
        type(self).asked = self.path
        self.send_response(self.status)
        self.end_headers()
        self.wfile.write(self.body)

    def log_message(self, *_: object) -> None:
        """Say nothing."""


@pytest.fixture
def server() -> Iterator[str]:
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Server) as running:
        threading.Thread(target=running.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{running.server_port}/v1/forecast"
        running.shutdown()


def test_a_forecast_is_fetched_for_the_site_and_read_as_plans_read_it(server: str, tmp_path: Path) -> None:

    Server.status, Server.body = 200, json.dumps(content("", "_member01")).encode()
    path = tmp_path / "forecast.json"
    assert fetch(address(SITE, server, ensemble=True), path) == 2
    assert len(read_forecast(path)) == 2
    asked = parse_qs(urlparse(Server.asked).query)
    assert asked["latitude"] == [f"{SITE.latitude:g}"]
    assert asked["wind_speed_unit"] == ["ms"]
    assert asked["models"] == ["icon_seamless"]
    assert int(asked["forecast_days"][0]) == 4, "a horizon of two days, the day after it, and today"
    assert [one.name for one in tmp_path.iterdir()] == ["forecast.json"]


@pytest.mark.parametrize(
    ("status", "body", "reason"),
    [
        (200, b"<html>maintenance</html>", "not JSON"),
        (200, b'{"error": true, "reason": "too many requests"}', "too many requests"),
        (503, b"", "503"),
        (200, b" " * 100, "larger"),
    ],
)
def test_an_answer_that_is_no_forecast_leaves_the_old_one(
    server: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, status: int, body: bytes, reason: str
) -> None:
    if reason == "larger":
        monkeypatch.setattr(fetching, "LARGEST_DOCUMENT", 50)
    Server.status, Server.body = status, body
    path = tmp_path / "forecast.json"
    path.write_text("the old one")
    with pytest.raises(IgrowError, match=reason):
        fetch(address(SITE, server, ensemble=False), path)
    assert path.read_text() == "the old one"
    assert [one.name for one in tmp_path.iterdir()] == ["forecast.json"]


def test_no_server_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(IgrowError, match="no answer"):
        fetch(address(SITE, "http://127.0.0.1:9/v1/forecast", ensemble=False), tmp_path / "forecast.json")


def test_where_the_last_days_tell_no_weather_the_date_does() -> None:
    """The weather station died last week; the season knows what January is like."""
    weather = np.zeros((6, 24, 6))
    weather[:, :, 0] = np.array([4.0, 6.0, 5.0, 7.0, 6.0, 8.0])[:, None]
    weather[:, 12, 3] = 200.0
    season = SeasonPlan(
        np.datetime64(START - 11 * 86_400, "s"), 30, 5, 1, np.zeros(7, dtype=np.float32), 0.0, (), (), weather
    )
    station_dead = log().with_columns({"outdoor_temperature": np.full(len(log()), np.nan)})
    course, problem = _without_forecast(station_dead, season, START, 240)
    assert "usual at this date" in problem
    assert course[0, 0] == 6.0
    assert course[-1, 0] == 7.0
    assert course[12, 3] == 200.0
    assert _without_forecast(log(), season, START, 24)[1] == ""
    with pytest.raises(IgrowError, match="no outdoor_temperature"):
        _without_forecast(station_dead, None, START, 24)
    with pytest.raises(IgrowError, match="no outdoor_temperature"):
        _without_forecast(station_dead, replace(season, days=5), START, 24)
