"""The page in a real browser: on a telephone and a desk, light and dark, by mouse and by keyboard alone.

Needs Debian's Chromium (`apt-get install chromium`; `.ci/run` installs it). `make page-pictures` keeps the pictures
that the documentation shows.
"""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from igrow.core.language import LANGUAGES
from igrow.edge.overriding import override_file
from igrow.edge.page.password import hashed, write_password
from igrow.edge.separating_tests import approval_file, read_approval
from igrow.edge.sources.override import read_leases
from tests import needs
from tests.page.page_bench import (
    CONFOUNDED,
    PASSWORD,
    ROOT,
    TESTS,
    Told,
    alarm,
    fill_log,
    pages_of,
    served,
    state,
    write_greenhouse,
)

LOOKS = [(width, scheme) for width in (390, 1280) for scheme in ("light", "dark")]
PICTURES = ROOT / "docs" / "page"
KEPT = ("calm-1280-light", "plan-1280-light", "calm-390-dark", "not-heard-390-light")
"""The pictures that docs/page.md shows."""
SECONDS = 20_000
"""Longest wait for anything, in milliseconds: this machine may be busy."""


class Greenhouse:
    """A served page with its daemon."""

    def __init__(self, folder: Path, told: Told, port: int) -> None:
        self.folder = folder
        self.told = told
        self.url = f"http://localhost:{port}"
        self.refusing = False
        """A test answers for the server, with 503."""


@pytest.fixture(scope="module")
def greenhouse(tmp_path_factory) -> Iterator[Greenhouse]:
    folder, told = tmp_path_factory.mktemp("greenhouse"), Told()
    path = write_greenhouse(folder, TESTS)
    fill_log(folder)
    write_password(folder / "state", hashed(PASSWORD))
    with served(pages_of(path, told)) as server:
        yield Greenhouse(folder, told, server.port)


@pytest.fixture(scope="module")
def browser():
    chromium = needs.program("chromium", "tests/page/install-browser.sh")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        launched = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        yield launched
        launched.close()


@pytest.fixture
def visit(browser, greenhouse):
    """Opens pages in a context of the asked look; at the end nothing may have gone wrong in any of them."""
    contexts, wrong = [], []

    def open_page(width: int = 1280, scheme: str = "light", **options):
        context = browser.new_context(viewport={"width": width, "height": 900}, color_scheme=scheme, **options)
        context.set_default_timeout(SECONDS)
        contexts.append(context)
        page = context.new_page()
        page.on("console", lambda said: wrong.append(said.text) if said.type == "error" else None)
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on(
            "request", lambda request: None if request.url.startswith(greenhouse.url) else wrong.append(request.url)
        )
        page.goto(greenhouse.url)
        return page

    greenhouse.told.said, greenhouse.told.silent, greenhouse.refusing = state(), False, False
    for written in (override_file, approval_file):
        written(greenhouse.folder / "state").unlink(missing_ok=True)
    yield open_page
    for context in contexts:
        context.close()
    assert [text for text in wrong if "status of 503" not in text or not greenhouse.refusing] == []


def sign_in(page, who: str = "Anna") -> None:
    page.get_by_role("link", name="Sign in").click()
    page.get_by_label("Your name").fill(who)
    page.get_by_label("Password").fill(PASSWORD)
    page.get_by_role("button", name="Sign in").click()
    page.get_by_role("button", name="Sign out").wait_for()


def violations(page) -> list[str]:
    from axe_playwright_python.sync_playwright import Axe

    result = Axe().run(page, options={"resultTypes": ["violations"]}).response
    assert len(result["passes"]) > 15
    return [f"{one['id']}: {node['html'][:120]}" for one in result["violations"] for node in one["nodes"]]


def unfold(page) -> None:
    page.evaluate("document.querySelectorAll('details').forEach((one) => { one.open = true; })")


def fits(page) -> bool:
    return bool(page.evaluate("document.documentElement.scrollWidth <= window.innerWidth"))


def keep(taken: bytes, name: str) -> None:
    """Keep a picture for the documentation, where that is asked for."""
    assert len(taken) > 5000
    if os.environ.get("IGROW_PICTURES") and name in KEPT:
        from PIL import Image

        PICTURES.mkdir(exist_ok=True)
        Image.open(io.BytesIO(taken)).convert("RGB").quantize(96).save(PICTURES / f"{name}.png", optimize=True)


def top(page, height: int) -> bytes:
    width = page.viewport_size["width"]
    return bytes(page.screenshot(full_page=True, clip={"x": 0, "y": 0, "width": width, "height": height}))


@pytest.mark.parametrize(("width", "scheme"), LOOKS)
def test_every_state_of_the_page_passes_the_rules_of_accessibility_and_fits_its_screen(
    visit, greenhouse, width, scheme
):
    page = visit(width, scheme)
    unfold(page)
    assert violations(page) == []
    assert fits(page)
    page.reload()
    keep(top(page, 1900 if width == 1280 else 1700), f"calm-{width}-{scheme}")
    keep(page.locator("#plan").screenshot(), f"plan-{width}-{scheme}")
    page.get_by_role("link", name="Sign in").click()
    assert violations(page) == []
    page.go_back()
    sign_in(page)
    greenhouse.told.said = state(
        link_ok=False,
        alarms=[
            alarm("link", "no point of the PLC can be read: check cable, address and power", "critical"),
            alarm("sensor wind_speed", "wind_speed is frozen: exactly 4.1 m s-1 for 0.7 h", "warning", 7200.0),
            alarm("service planning", "planning failed", "notice"),
        ],
        problems=["the disk is full"],
        plan=None,
    )
    page.goto(greenhouse.url)
    page.locator("#change-heating_setpoint summary").click()
    page.locator("#change-recipe summary").click()
    assert violations(page) == []
    assert fits(page)
    keep(top(page, 900), f"not-heard-{width}-{scheme}")


@pytest.mark.parametrize("code", LANGUAGES[1:])
def test_a_telephone_shows_the_page_in_each_language(visit, code):
    page = visit(390, locale=code)
    assert page.evaluate("document.documentElement.lang") == code
    unfold(page)
    assert violations(page) == []
    assert fits(page)
    # Wide tables may be moved to and fro; that of plan and recipe is seen at once.
    assert page.locator("#money .scroll").evaluate("(one) => one.scrollWidth <= one.clientWidth")


def test_a_setpoint_is_taken_and_given_back_by_keyboard_alone(visit, greenhouse):
    page = visit()
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.className") == "skip"
    sign_in(page)
    page.locator("#change-heating_setpoint summary").focus()
    page.keyboard.press("Enter")
    page.keyboard.press("Tab")
    page.keyboard.type("18.5")
    page.keyboard.press("Enter")
    page.get_by_text("Heating setpoint: 18.5 °C by hand for 2 h").wait_for()
    lease = read_leases(override_file(greenhouse.folder / "state"))["heating_setpoint"]
    assert (lease.value, lease.seconds, lease.by) == (18.5, 7200.0, "Anna (page)")
    page.get_by_role("button", name="Give back").focus()
    page.keyboard.press("Enter")
    page.get_by_text("Heating setpoint is given back").wait_for()
    assert read_leases(override_file(greenhouse.folder / "state")) == {}


def test_all_works_without_scripts(visit, greenhouse):
    page = visit(390, java_script_enabled=False)
    assert page.locator("#courses .narrow svg.chart").count() >= 6
    sign_in(page)
    page.locator("#change-recipe summary").click()
    page.get_by_role("button", name="My recipe decides").click()
    page.get_by_text("Your recipe decides for 2 h").wait_for()
    assert read_leases(override_file(greenhouse.folder / "state"))["recipe"].by == "Anna (page)"
    page.get_by_role("button", name="Let plans decide again").click()
    page.get_by_text("Plans decide again").wait_for()
    page.get_by_role("button", name="I know").click()
    page.get_by_text("known to Anna (page)").wait_for()


@pytest.mark.parametrize("width", [390, 1280])
def test_a_separating_test_is_approved_and_withdrawn(visit, greenhouse, width):
    greenhouse.told.said["bundle"]["confounded"] = [CONFOUNDED]
    page = visit(width)
    sign_in(page)
    assert violations(page) == []
    assert fits(page)
    page.get_by_role("button", name="Approve it, for one run").click()
    page.get_by_text("Approved by Anna (page).").wait_for()
    assert violations(page) == []
    assert fits(page)
    path = approval_file(greenhouse.folder / "state")
    approval = read_approval(path)
    assert approval is not None
    assert (approval.test, approval.by, approval.is_over) == ("vent_square_wave", "Anna (page)", False)
    page.get_by_role("button", name="Withdraw it").click()
    page.get_by_text("has ended: withdrawn by Anna (page).").wait_for()
    ended = read_approval(path)
    assert ended is not None
    assert ended.is_over


def test_the_page_renews_itself_and_leaves_a_form_in_use_alone(visit, greenhouse):
    page = visit()
    sign_in(page)
    page.clock.install()
    page.reload()
    page.locator("#change-co2_setpoint summary").click()
    page.get_by_label("CO₂ setpoint, 400 to 1,000 ppm").fill("640")
    said = state()
    said["values"]["air_temperature"]["value"] = 23.7
    said["setpoints"]["co2_setpoint"]["shown"] = 555.0
    greenhouse.told.said = said
    page.clock.fast_forward(16_000)
    page.get_by_text("23.7").first.wait_for()
    assert page.get_by_label("CO₂ setpoint, 400 to 1,000 ppm").input_value() == "640"
    assert not page.locator("#stale").is_visible()


def test_a_page_that_cannot_be_renewed_says_so(visit, greenhouse):
    page = visit()
    page.clock.install()
    page.reload()
    greenhouse.refusing = True
    page.route("**/*", lambda route: route.fulfill(status=503, body="no"))
    with page.expect_response(lambda response: response.status == 503):
        page.clock.fast_forward(16_000)
    page.get_by_text("This page could not be renewed").wait_for()
    page.unroute("**/*")
    page.clock.fast_forward(16_000)
    page.locator("#stale").wait_for(state="hidden")


def test_a_daemon_that_is_gone_makes_the_headline_red(visit, greenhouse):
    greenhouse.told.silent = True
    page = visit(390, "dark")
    assert "bad" in page.locator("#lead").get_attribute("class").split()
    assert "The controller is not heard" in page.title()


def test_the_charts_tell_their_lines_apart_without_colour(visit):
    page = visit()
    dashes = (
        page.locator("#courses figure")
        .first.locator(".wide path.line")
        .evaluate_all(
            "lines => lines.map((line) => getComputedStyle(line).strokeDasharray + getComputedStyle(line).strokeWidth)"
        )
    )
    assert len(dashes) == len(set(dashes)) == 4


@pytest.mark.parametrize("width", [390, 1280])
def test_the_reason_of_a_held_setpoint_has_room_at_any_width(visit, width):
    page = visit(width)
    unfold(page)
    shown = [one for one in page.get_by_text("above the limit of 28").all() if one.is_visible()]
    assert len(shown) == 1
    box = shown[0].bounding_box()
    assert box is not None
    assert box["width"] > 150
