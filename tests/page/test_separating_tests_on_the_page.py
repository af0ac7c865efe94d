"""A grower approves a separating test from the page, and withdraws it; nobody else does."""

from __future__ import annotations

import html
from collections.abc import AsyncIterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from igrow.edge.moment import Moment
from igrow.edge.page.password import write_password
from igrow.edge.page.server import PageServer
from igrow.edge.separating_tests import Approval, approval_file, read_approval
from igrow.edge.separating_tests.approval import to_plain
from igrow.edge.state_file import write_state
from tests.page.page_bench import CONFOUNDED, TESTS, Told, pages_of, state, write_greenhouse
from tests.page.test_page_over_http import HASHED, Answer, Visitor

TEST = "vent_square_wave"
COURSE = "Lee vents at 15 %, 5 % in turn, 30 min each, 4 h in all."
APPROVE, WITHDRAW = "Approve it, for one run", "Withdraw it"


def asking(**changes: Any) -> dict[str, Any]:
    """A daemon whose bundle names causes that a test would tell apart."""
    said = state(**changes)
    said["bundle"]["confounded"] = [CONFOUNDED]
    return said


class Grower(Visitor):
    """A visitor who looks at separating tests."""

    @property
    def approval(self) -> Approval | None:
        return read_approval(approval_file(self.folder / "state"))

    async def text(self) -> str:
        return html.unescape((await self.get()).body)

    async def wish(self, token: str, *headers: str) -> Answer:
        return await self.post("/act", {"do": "approve", "test": TEST, "token": token}, *headers)

    def note(self, approval: Approval) -> None:
        """Leave the approval as the daemon would."""
        assert write_state(approval_file(self.folder / "state"), to_plain(approval)) == ""


async def started(folder: Path, daemon: str) -> Grower:
    told = Told(asking())
    path = write_greenhouse(folder, daemon)
    write_password(folder / "state", HASHED)
    server = PageServer(pages_of(path, told))
    await server.start("127.0.0.1", 0)
    return Grower(folder, told, server)


@pytest.fixture
async def grower(tmp_path: Path) -> AsyncIterator[Grower]:
    visitor = await started(tmp_path, TESTS)
    yield visitor
    await visitor.server.close()


async def test_whoever_looks_reads_what_is_asked_for_and_only_who_is_signed_in_may_approve(grower: Grower) -> None:
    body = await grower.text()
    assert "The diagnosis could not tell these apart" in body
    assert COURSE in body
    assert "at night, whole between sunset and sunrise; wind speed at most 5.0 m/s" in body
    assert APPROVE not in body
    answer = await grower.wish("")
    assert (answer.status, grower.approval) == (303, None)
    assert "Location: /sign-in" in answer.head
    await grower.sign_in()
    assert APPROVE in await grower.text()


async def test_an_approval_bears_its_name_and_is_withdrawn_by_the_same_road(grower: Grower) -> None:
    await grower.sign_in()
    page = await grower.act(do="approve", test=TEST)
    assert "approved for one run within 3 days" in page.body
    approval = grower.approval
    assert approval is not None
    assert (approval.test, approval.by, approval.ended) == (TEST, "Anna (page)", "")
    assert "Approved by Anna (page). It waits for its weather, for 3 days at most." in page.body
    assert WITHDRAW in page.body
    assert APPROVE not in page.body
    # One at a time: a page that is older than the approval changes nothing.
    page = await grower.act(do="approve", test=TEST)
    assert "approved already, by Anna (page)" in page.body
    assert grower.approval == approval
    page = await grower.act(do="withdraw")
    assert grower.approval == replace(approval, ended="withdrawn by Anna (page)")
    assert "has ended: withdrawn by Anna (page)." in page.body
    assert APPROVE in page.body
    assert "no test is approved any more" in (await grower.act(do="withdraw")).body


async def test_a_form_of_another_page_or_session_approves_nothing(grower: Grower) -> None:
    await grower.sign_in()
    token = await grower.token()
    for answer in (
        await grower.wish(""),
        await grower.wish(token[:-1]),
        await grower.wish(token, "Origin: http://evil.example"),
        await grower.wish(token, "Sec-Fetch-Site: cross-site"),
    ):
        assert (answer.status, grower.approval) == (403, None)
    assert (await grower.wish(token)).status == 303
    approval = grower.approval
    assert approval is not None
    answer = await grower.post("/act", {"do": "withdraw", "token": token[:-1]})
    assert (answer.status, grower.approval) == (403, approval)


async def test_it_says_what_the_test_waits_for_that_it_runs_and_how_it_ended(grower: Grower) -> None:
    approval = Approval(TEST, "Anna", 1, 86_400.0)
    grower.note(approval)
    said = {"test": TEST, "by": "Anna", "running": False, "waits_for": "it is no night", "ended": ""}
    grower.told.said = asking(separating_test=said)
    assert "Approved by Anna. It waits: it is no night." in await grower.text()
    begun = replace(approval, begun=Moment("boot", 1.0, None))
    grower.note(begun)
    grower.told.said = state(separating_test=said | {"running": True, "waits_for": ""})  # asked for no more
    body = await grower.text()
    assert "Approved by Anna. It runs." in body
    assert COURSE in body
    grower.note(replace(begun, ended="it ran to its end"))
    assert "separating-tests-title" not in await grower.text()
    grower.told.said = asking()
    assert "The last test, vents to and fro, has ended: it ran to its end." in await grower.text()


@pytest.mark.parametrize(
    "daemon", ["", TESTS.replace("permitted: true", "permitted: false"), TESTS.replace("high: 60", "high: 10")]
)
async def test_where_it_is_not_permitted_or_not_possible_nothing_is_shown_and_nothing_approved(
    tmp_path: Path, daemon: str
) -> None:
    grower = await started(tmp_path, daemon)
    await grower.sign_in()
    assert f'value="{TEST}"' not in (await grower.get()).body
    page = await grower.act(do="approve", test=TEST)
    assert 'class="said bad" role="status"' in page.body
    assert grower.approval is None
    page = await grower.act(do="approve", test="<script>")
    assert "is no separating test" in page.body
    assert "<script>" not in page.body
    await grower.server.close()


async def test_nothing_is_asked_for_where_the_diagnosis_is_sure(grower: Grower) -> None:
    grower.told.said = state()
    assert "separating-tests-title" not in await grower.text()
