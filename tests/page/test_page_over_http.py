"""Who may do what over HTTP, and that no visitor, however hostile, costs much."""

from __future__ import annotations

import asyncio
import contextlib
import gzip
import json
import re
import socket
import threading
from dataclasses import dataclass
from urllib.parse import urlencode

import pytest

from igrow.edge.notifications.acknowledged import ACKNOWLEDGED_FILE, read_acknowledged
from igrow.edge.overriding import override, override_file
from igrow.edge.page import server as page_server
from igrow.edge.page.password import hashed, remove_password, write_password
from igrow.edge.page.server import PageServer
from igrow.edge.sources.override import read_leases
from tests.page.page_bench import PASSWORD, Told, alarm, found_in, pages_of, state, write_greenhouse
from tests.patience import PATIENCE

HASHED = hashed(PASSWORD)


@dataclass
class Answer:
    status: int
    head: str
    body: str

    @property
    def cookie(self) -> str:
        return found_in(r"Set-Cookie: ([^;]*)", self.head)


class Visitor:
    """Speaks HTTP as plainly as a test can."""

    def __init__(self, folder, told: Told, server: PageServer) -> None:
        self.folder = folder
        self.told = told
        self.server = server
        self.cookie = ""

    async def send(self, raw: bytes, *, wait: float = PATIENCE) -> Answer:
        reader, writer = await asyncio.open_connection("127.0.0.1", self.server.port)
        writer.write(raw)
        answer = (await asyncio.wait_for(reader.read(), wait)).decode()
        writer.close()
        head, _, body = answer.partition("\r\n\r\n")
        return Answer(int(head.split()[1]) if head else 0, head, body)

    async def get(self, path: str = "/", *headers: str) -> Answer:
        lines = ["Host: localhost", *([f"Cookie: {self.cookie}"] if self.cookie else []), *headers]
        return await self.send((f"GET {path} HTTP/1.1\r\n" + "\r\n".join(lines) + "\r\n\r\n").encode())

    async def post(self, path: str, fields: dict[str, str], *headers: str) -> Answer:
        body = urlencode(fields)
        lines = ["Host: localhost", f"Content-Length: {len(body)}", "Content-Type: application/x-www-form-urlencoded"]
        lines += [f"Cookie: {self.cookie}"] if self.cookie else []
        return await self.send(
            (f"POST {path} HTTP/1.1\r\n" + "\r\n".join([*lines, *headers]) + "\r\n\r\n" + body).encode()
        )

    async def sign_in(self, who: str = "Anna", password: str = PASSWORD) -> Answer:
        answer = await self.post("/sign-in", {"who": who, "password": password})
        if answer.status == 303:
            self.cookie = answer.cookie
        return answer

    async def token(self) -> str:
        return found_in(r'name="token" value="([^"]*)"', (await self.get()).body)

    async def act(self, **fields: str) -> Answer:
        answer = await self.post("/act", {"token": await self.token(), **fields})
        assert answer.status == 303
        return await self.get()

    @property
    def leases(self):
        return read_leases(override_file(self.folder / "state"))


@pytest.fixture
async def visitor(tmp_path):
    told = Told()
    path = write_greenhouse(tmp_path)
    write_password(tmp_path / "state", HASHED)
    server = PageServer(pages_of(path, told))
    await server.start("127.0.0.1", 0)
    yield Visitor(tmp_path, told, server)
    await server.close()


async def until(true, seconds: float = PATIENCE) -> None:
    """Wait for something to become true."""
    async with asyncio.timeout(seconds):
        while not true():  # noqa: ASYNC110 - nobody tells when
            await asyncio.sleep(0.02)


# what everybody sees


async def test_anybody_may_look_and_nobody_may_act_without_signing_in(visitor: Visitor):
    answer = await visitor.get()
    assert answer.status == 200
    assert "The plan decides" in answer.body
    assert "<form" not in answer.body
    answer = await visitor.post("/act", {"do": "override", "setpoint": "heating_setpoint", "value": "18", "hours": "2"})
    assert (answer.status, visitor.leases) == (303, {})
    assert "Location: /sign-in" in answer.head


async def test_without_a_password_the_page_only_shows_and_says_how_to_set_one(visitor: Visitor):
    remove_password(visitor.folder / "state")
    body = (await visitor.get()).body
    assert "igrow-edge password" in body
    assert "Sign in" not in body
    answer = await visitor.sign_in()
    assert answer.status == 200
    assert "igrow-edge password" in answer.body
    assert visitor.cookie == ""


async def test_everything_comes_from_this_server_under_a_strict_policy(visitor: Visitor):
    answer = await visitor.get()
    policy = found_in(r"Content-Security-Policy: (.*)", answer.head)
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert not re.search(r"https?://", answer.body.replace("http://www.w3.org/2000/svg", ""))
    assert not re.search(r"<[^>]* style=|<[^>]* on\w+=|<script>|<style", answer.body)
    for path in re.findall(r'(?:href|src)="(/[\w.]+)"', answer.body):
        if "." in path:
            found = await visitor.get(path)
            assert found.status == 200
            assert "http://" not in found.body.replace("http://www.w3.org/2000/svg", "")


async def test_a_browser_that_takes_it_gets_the_page_compressed(visitor: Visitor):
    plain = await visitor.get()
    reader, writer = await asyncio.open_connection("127.0.0.1", visitor.server.port)
    writer.write(b"GET / HTTP/1.1\r\nHost: localhost\r\nAccept-Encoding: gzip;q=1.0, br\r\n\r\n")
    head, _, body = (await asyncio.wait_for(reader.read(), PATIENCE)).partition(b"\r\n\r\n")
    writer.close()
    assert b"Content-Encoding: gzip" in head
    assert len(gzip.decompress(body)) == pytest.approx(len(plain.body.encode()), rel=0.01)


@pytest.mark.parametrize("path", ["/etc/passwd", "/../page.css", "/templates/page.html", "/page.html", "//", "/act"])
async def test_there_is_nothing_else_to_be_had(visitor: Visitor, path: str):
    assert (await visitor.get(path)).status == 404


async def test_a_flood_of_alarms_hides_nothing_and_keeps_the_climate_near(visitor: Visitor):
    """Forty alarms stood before the first temperature; the worst still do, the others fold away beneath them."""
    levels = ("notice", "warning", "critical")
    many = [alarm(f"alarm {number}", f"alarm number {number}", levels[number % 3]) for number in range(40)]
    visitor.told.said = state(alarms=many)
    await visitor.sign_in()
    body = (await visitor.get()).body
    shown, folded = body.split('<details id="more-alarms"><summary>More alarms: 34</summary>')
    assert shown.count('<li class="critical">') == 6
    assert '<li class="notice">' not in shown
    assert folded.split("</details>")[0].count('value="acknowledge"') == 34
    visitor.told.said = state(alarms=many[:6])
    assert "More alarms" not in (await visitor.get()).body


async def test_what_the_daemon_says_cannot_become_markup(visitor: Visitor):
    evil = "<script>alert(1)</script>"
    visitor.told.said = state(
        site=evil, why=evil, alarms=[alarm(evil, evil, "critical")], problems=[evil], source=evil,
        bundle={"name": evil, "effects": [evil], "last_verdict": evil, "refusal": evil},
    )  # fmt: skip
    await visitor.sign_in(evil)
    assert "<script>" not in (await visitor.get()).body


@pytest.mark.parametrize(
    ("host", "status"),
    [
        ("Host: localhost:8421", 200), ("Host: 127.0.0.1", 200), ("Host: [::1]:8421", 200), ("host: LOCALHOST", 200),
        ("Host: 192.168.1.5:8421", 200), ("Host: greenhouse.local", 200),
        ("Host: evil.example", 421), ("Host: localhost.evil.example", 421), ("Host: localhost:8421.evil.example", 421),
        ("Host: 127.0.0.1.evil.example", 421), ("Host: localhost\r\nHost: evil.example", 400), ("X: y", 421),
        ("Host:", 421),
    ],
)  # fmt: skip
async def test_a_name_that_points_here_from_elsewhere_is_not_served(tmp_path, host: str, status: int):
    server = PageServer(pages_of(write_greenhouse(tmp_path, "page: {names: [greenhouse.local]}"), Told()))
    await server.start("127.0.0.1", 0)
    visitor = Visitor(tmp_path, Told(), server)
    assert (await visitor.send(f"GET /sign-in HTTP/1.1\r\n{host}\r\n\r\n".encode())).status == status
    await server.close()


# signing in


async def test_a_sign_in_gives_a_cookie_that_no_script_and_no_other_site_can_use(visitor: Visitor):
    answer = await visitor.sign_in()
    assert answer.status == 303
    cookie = found_in(r"Set-Cookie: (.*)", answer.head)
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    assert "<b>Anna</b>" in (await visitor.get()).body


async def test_a_wrong_password_and_a_missing_name_open_nothing(visitor: Visitor):
    assert (await visitor.sign_in(password="tomatoes are blue")).status == 403
    assert "Your name is missing" in (await visitor.sign_in(who=" \t")).body
    assert visitor.cookie == ""


async def test_guessing_is_slowed_down_and_the_right_one_waits_too(visitor: Visitor):
    for _ in range(5):
        assert (await visitor.sign_in(password="a guess at it")).status == 403
    answer = await visitor.sign_in()
    assert answer.status == 429
    assert "Retry-After: " in answer.head


async def test_a_guessed_or_an_ended_session_is_none(visitor: Visitor):
    await visitor.sign_in()
    kept = visitor.cookie
    await visitor.post("/sign-out", {"token": await visitor.token()})
    visitor.cookie = kept
    assert "Sign out" not in (await visitor.get()).body
    visitor.cookie = f"{kept.partition('=')[0]}=guess"
    assert "Sign out" not in (await visitor.get()).body


async def test_pages_of_two_compartments_on_one_machine_keep_their_visitors_apart(visitor: Visitor, tmp_path):
    await visitor.sign_in()
    other = write_greenhouse(tmp_path / "other")
    (tmp_path / "other" / "site.yaml").write_text((tmp_path / "site.yaml").read_text().replace("name: ", "name: b-"))
    write_password(tmp_path / "other" / "state", HASHED)
    server = PageServer(pages_of(other, Told()))
    await server.start("127.0.0.1", 0)
    elsewhere = Visitor(tmp_path / "other", Told(), server)
    await elsewhere.sign_in()
    assert elsewhere.cookie.partition("=")[0] != visitor.cookie.partition("=")[0]
    await server.close()


async def test_a_new_password_signs_everybody_out_at_once(visitor: Visitor):
    await visitor.sign_in()
    write_password(visitor.folder / "state", hashed("another password"))
    assert "Sign out" not in (await visitor.get()).body


# acting


async def test_a_setpoint_is_taken_for_a_time_in_the_name_of_who_did_it_and_given_back(visitor: Visitor):
    await visitor.sign_in()
    page = await visitor.act(do="override", setpoint="heating_setpoint", value="18,5", hours="4")
    assert "Heating setpoint: 18.5 °C by hand for 4 h" in page.body
    lease = visitor.leases["heating_setpoint"]
    assert (lease.value, lease.seconds, lease.by) == (18.5, 4 * 3600.0, "Anna (page)")
    assert "by hand for 4 h. The PLC" not in (await visitor.get()).body  # said once
    await visitor.act(do="override", setpoint="lamp_on", value="50", hours="1")
    assert visitor.leases["lamp_on"].value == 0.5
    await visitor.act(do="release", setpoint="heating_setpoint")
    assert list(visitor.leases) == ["lamp_on"]
    assert json.loads(override_file(visitor.folder / "state").read_text())["given_back_by"] == "Anna (page)"


async def test_wishes_at_the_same_moment_are_all_kept(visitor: Visitor):
    configuration = visitor.server._pages.configuration()

    def wish(name: str, value: float) -> None:
        for _ in range(20):
            override(configuration, {name: value}, 3600.0, by="somebody")

    wishes = {"heating_setpoint": 18.0, "co2_setpoint": 500.0, "lamp_on": 0.0, "irrigation_on": 1.0}
    await asyncio.gather(*(asyncio.to_thread(wish, name, value) for name, value in wishes.items()))
    assert {name: lease.value for name, lease in visitor.leases.items()} == wishes


async def test_recipe_and_plan(visitor: Visitor):
    await visitor.sign_in()
    await visitor.act(do="recipe", hours="24")
    assert visitor.leases["recipe"].seconds == 86_400.0
    page = await visitor.act(do="plan")
    assert "Plans decide again" in page.body
    assert visitor.leases == {}


async def test_an_alarm_is_acknowledged(visitor: Visitor):
    await visitor.sign_in()
    page = await visitor.act(do="acknowledge", alarm="sensor wind_speed")
    assert "known to Anna (page)" in page.body
    assert read_acknowledged(visitor.folder / "state" / ACKNOWLEDGED_FILE)["sensor wind_speed"].by == "Anna (page)"


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"do": "override", "setpoint": "heating_setpoint", "value": "50", "hours": "2"}, "limits are 12 to 28"),
        ({"do": "override", "setpoint": "heating_setpoint", "value": "nan", "hours": "2"}, "limits are 12 to 28"),
        ({"do": "override", "setpoint": "heating_setpoint", "value": "1e400", "hours": "2"}, "limits are 12 to 28"),
        ({"do": "override", "setpoint": "heating_setpoint", "value": "warm", "hours": "2"}, "no number"),
        ({"do": "override", "setpoint": "vent_lee", "value": "50", "hours": "2"}, "is no setpoint of this site"),
        ({"do": "override", "setpoint": "recipe", "value": "1", "hours": "2"}, "is no setpoint of this site"),
        ({"do": "override", "setpoint": "heating_setpoint", "value": "18", "hours": "1e9"}, "for how long?"),
        ({"do": "override", "setpoint": "heating_setpoint", "value": "18"}, "for how long?"),
        ({"do": "release", "setpoint": "recipe"}, "is no setpoint of this site"),
        ({"do": "acknowledge", "alarm": "nothing like it"}, "over already"),
        ({"do": "format the disk"}, "not known"),
        ({}, "not known"),
    ],
)
async def test_what_makes_no_sense_is_refused_in_one_line_and_changes_nothing(visitor: Visitor, fields, said):
    await visitor.sign_in()
    page = await visitor.act(**fields)
    assert said in page.body
    assert visitor.leases == {}


async def test_a_form_of_another_page_does_nothing(visitor: Visitor):
    await visitor.sign_in()
    wish = {"do": "override", "setpoint": "heating_setpoint", "value": "18", "hours": "2"}
    token = await visitor.token()
    for fields, headers in (
        (wish, ()),
        (wish | {"token": ""}, ()),
        (wish | {"token": token[:-1]}, ()),
        (wish | {"token": "ü"}, ()),
        (wish | {"token": token}, ("Origin: http://evil.example",)),
        (wish | {"token": token}, ("Origin: null",)),
        (wish | {"token": token}, ("Sec-Fetch-Site: cross-site",)),
    ):
        assert (await visitor.post("/act", fields, *headers)).status == 403
    assert visitor.leases == {}
    good = ("Origin: http://localhost", "Sec-Fetch-Site: same-origin")
    assert (await visitor.post("/act", wish | {"token": token}, *good)).status == 303
    assert list(visitor.leases) == ["heating_setpoint"]


async def test_another_page_cannot_sign_anybody_in_or_out(visitor: Visitor):
    fields = {"who": "Anna", "password": PASSWORD}
    assert (await visitor.post("/sign-in", fields, "Origin: http://evil.example")).status == 403
    await visitor.sign_in()
    assert (await visitor.post("/sign-out", {})).status == 403


async def test_a_token_is_of_one_session(visitor: Visitor):
    await visitor.sign_in()
    first, token = visitor.cookie, await visitor.token()
    visitor.cookie = ""
    await visitor.sign_in("Bert")
    assert visitor.cookie != first
    assert (await visitor.post("/act", {"do": "plan", "token": token})).status == 403


# hostile visitors


FORM = "Content-Type: application/x-www-form-urlencoded\r\n"


@pytest.mark.parametrize(
    ("raw", "status"),
    [
        (b"\r\n\r\n", 400), (b"\xff\xfe\r\n\r\n", 400), (b"GET\r\n\r\n", 400), (b"GET / SPDY/3\r\n\r\n", 400),
        (b"GET http://evil/ HTTP/1.1\r\nHost: localhost\r\n\r\n", 400),
        (b"DELETE / HTTP/1.1\r\nHost: localhost\r\n\r\n", 405),
        (b"GET / HTTP/1.1\r\nHost: localhost\r\nnonsense\r\n\r\n", 400),
        (b"GET / HTTP/1.1\r\nHost : localhost\r\n\r\n", 400),
        (b"POST /act HTTP/1.1\r\nHost: localhost\r\n\r\n", 411),
        (b"POST /act HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n", 411),
        (b"POST /act HTTP/1.1\r\nHost: localhost\r\nContent-Length: -1\r\n\r\n", 411),
        (b"POST /act HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1\r\nContent-Length: 2\r\n\r\n", 400),
        (b"POST /act HTTP/1.1\r\nHost: localhost\r\nContent-Length: 99999999999\r\n\r\n", 413),
        (b"POST /sign-in HTTP/1.1\r\nHost: localhost\r\nContent-Length: 2\r\nContent-Type: text/json\r\n\r\n{}", 415),
        (f"POST /sign-in HTTP/1.1\r\nHost: localhost\r\nContent-Length: 120\r\n{FORM}\r\n{'a=1&' * 30}".encode(), 200),
        (f"POST /sign-in HTTP/1.1\r\nHost: localhost\r\nContent-Length: 160\r\n{FORM}\r\n{'a=1&' * 40}".encode(), 400),
        (b"GET / HTTP/1.1\r\nHost: localhost\r\nCookie: \x00\xff=;;=;\r\n\r\n", 200),
        (b"GET /?span=" + b"../" * 500 + b" HTTP/1.1\r\nHost: localhost\r\n\r\n", 200),
    ],
)  # fmt: skip
async def test_garbage_is_answered_with_a_refusal(visitor: Visitor, raw: bytes, status: int):
    assert (await visitor.send(raw)).status == status


async def test_an_endless_head_is_cut_off(visitor: Visitor):
    reader, writer = await asyncio.open_connection("127.0.0.1", visitor.server.port)
    writer.write(b"GET / HTTP/1.1\r\nX: " + b"a" * 1_000_000)
    with contextlib.suppress(ConnectionError):
        answer = await asyncio.wait_for(reader.read(), PATIENCE)
        assert answer == b"" or answer.startswith(b"HTTP/1.1 431")
    writer.close()
    assert (await visitor.get()).status == 200


async def test_visitors_who_say_nothing_are_hung_up_on(visitor: Visitor, monkeypatch):
    monkeypatch.setattr(page_server, "REQUEST_SECONDS", 0.3)
    silent = [await asyncio.open_connection("127.0.0.1", visitor.server.port) for _ in range(10)]
    for _, writer in silent[:5]:
        writer.write(b"POST /sign-in HTTP/1.1\r\nHost: localhost\r\nContent-Length: 100\r\n\r\nwho=")
    for reader, writer in silent:
        await asyncio.wait_for(reader.read(), PATIENCE)
        writer.close()
    assert (await visitor.get()).status == 200
    await until(lambda: not visitor.server._visits)


class Counted(set):
    """Counts what was ever added: on a busy machine all may have gone before anybody looks."""

    added = 0

    def add(self, one) -> None:
        self.added += 1
        super().add(one)


async def test_visitors_who_read_nothing_are_hung_up_on(visitor: Visitor, monkeypatch):
    monkeypatch.setattr(page_server, "SEND_SECONDS", 0.3)
    visits = Counted()
    monkeypatch.setattr(visitor.server, "_visits", visits)
    deaf = []
    for _ in range(5):
        one = socket.socket()
        one.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1024)
        one.connect(("127.0.0.1", visitor.server.port))
        one.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")
        deaf.append(one)
    await until(lambda: visits.added == 5 and not visits)
    for one in deaf:
        one.close()


async def test_one_address_cannot_shut_out_the_others(visitor: Visitor):
    crowd = [await asyncio.open_connection("127.0.0.1", visitor.server.port) for _ in range(100)]
    await until(lambda: len(visitor.server._visits) == page_server.MOST_OF_ONE < page_server.MOST_CONNECTIONS)
    reader, writer = await asyncio.open_connection("127.0.0.1", visitor.server.port, local_addr=("127.0.0.2", 0))
    writer.write(b"GET /page.css HTTP/1.1\r\nHost: localhost\r\n\r\n")
    assert (await asyncio.wait_for(reader.read(), PATIENCE)).startswith(b"HTTP/1.1 200")
    for _, one in [*crowd, (None, writer)]:
        one.close()


async def test_a_storm_of_connections_harms_nobody_who_comes_after(visitor: Visitor):
    def storm() -> None:
        for _ in range(400):
            with socket.socket() as one:
                one.connect(("127.0.0.1", visitor.server.port))

    thread = threading.Thread(target=storm)
    thread.start()
    await asyncio.to_thread(thread.join)
    await until(lambda: not visitor.server._visits)
    assert (await visitor.get()).status == 200
    await until(lambda: visitor.server._of_one.total() == 0)


async def test_work_that_hangs_is_bounded_and_the_rest_is_told_to_come_back(visitor: Visitor, monkeypatch):
    monkeypatch.setattr(page_server, "WORK_SECONDS", 0.2)
    gate, before = threading.Event(), threading.active_count()
    monkeypatch.setattr(visitor.server._pages, "password", gate.wait)
    try:
        answers = [await visitor.get() for _ in range(page_server.MOST_AT_WORK + 2)]
        assert {answer.status for answer in answers} == {503}
        assert threading.active_count() <= before + page_server.MOST_AT_WORK + 1
        assert (await visitor.get("/page.css")).status == 200
    finally:
        gate.set()
    monkeypatch.undo()
    for _ in range(100):
        if (await visitor.get()).status == 200:
            break
        await asyncio.sleep(0.05)
    assert (await visitor.get()).status == 200


async def test_a_fault_of_ours_is_a_short_answer_and_the_next_visitor_is_served(visitor: Visitor):
    visitor.told.said = {"nonsense": True}
    answer = await visitor.get()
    assert answer.status == 500
    assert "Traceback" not in answer.body
    visitor.told.said = state()
    assert (await visitor.get()).status == 200


async def test_a_port_that_is_taken_is_one_line(visitor: Visitor):
    other = PageServer(visitor.server._pages)
    with pytest.raises(Exception, match=rf"page: port {visitor.server.port} of 127.0.0.1"):
        await other.start("127.0.0.1", visitor.server.port)
    await other.close()
