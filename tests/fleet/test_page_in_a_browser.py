"""The fleet's page as an operator sees it, on a telephone and on a desk: nothing is cut off."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import pytest

from igrow.trainer.fleet import page
from igrow.trainer.fleet.overview import SiteRow
from igrow.trainer.fleet.page import write_page
from tests import needs

NOW = datetime(2026, 3, 1, tzinfo=UTC)
LONG = "/srv/cooperative/fleet/state/archive/telemetry/site=greenhouse-at-the-old-mill/month=2026-02: Not a directory"


def test_a_large_fleet_goes_on_over_further_pages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page, "SITES", 2)
    rows = [SiteRow(f"site-{n}", 9 - n, (), None, "", "", None, None, None, None, None) for n in range(5)]
    first = write_page(tmp_path, rows, NOW)
    assert "site-1" in first.read_text()
    assert "site-2" not in first.read_text()
    assert "5 greenhouses" in (tmp_path / "page-3.html").read_text()
    assert "site-4" in (tmp_path / "page-3.html").read_text()
    assert 'href="page-3.html"' in first.read_text()
    # What a fleet that has become smaller no longer needs would show sites as they were long ago.
    write_page(tmp_path, rows[:2], NOW)
    assert sorted(one.name for one in tmp_path.glob("*.html")) == ["index.html"]
    assert "<nav" not in first.read_text()


@pytest.mark.parametrize(("width", "scheme"), [(390, "dark"), (1280, "light")])
def test_nothing_is_cut_off(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, width: int, scheme: str) -> None:
    chromium = needs.program("chromium", "tests/page/install-browser.sh")
    from playwright.sync_api import sync_playwright

    sentence = "The thermal screen leaves a gap of 4 % when it is closed."
    rows = [
        SiteRow("old-mill", 90, (LONG, "silent for 3 days"), None, "", "", None, None, None, None, None),
        SiteRow("north-7", 50, ("finding",), NOW, "20260201T000000Z", sentence, 42.0, 0.5, 0.43, NOW, None),
    ]
    monkeypatch.setattr(page, "SITES", 2)
    spare = [SiteRow(f"spare-{n}", 0, (), NOW, "", "", None, None, None, None, None) for n in range(60)]
    first = write_page(tmp_path, [*rows, *spare], NOW)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        tab = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)  # type: ignore[arg-type]
        tab.goto(first.as_uri())
        seen = tab.evaluate(
            "(({scrollWidth, clientWidth}) => [scrollWidth, clientWidth])(document.querySelector('.scroll'))"
        )
        whole = tab.evaluate("[document.documentElement.scrollWidth, document.documentElement.clientWidth]")
        names = [one.inner_text() for one in tab.query_selector_all("td.site")]
        browser.close()
    assert seen[0] <= seen[1]
    assert whole[0] <= whole[1]
    assert names == ["old-mill", "north-7"]
