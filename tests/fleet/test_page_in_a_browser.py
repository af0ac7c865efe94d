"""The fleet's page as an operator sees it, on a telephone and on a desk: nothing is cut off."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import pytest

from igrow.trainer.fleet.overview import SiteRow
from igrow.trainer.fleet.page import write_page
from tests import needs

NOW = datetime(2026, 3, 1, tzinfo=UTC)
LONG = "/srv/cooperative/fleet/state/archive/telemetry/site=greenhouse-at-the-old-mill/month=2026-02: Not a directory"


@pytest.mark.parametrize(("width", "scheme"), [(390, "dark"), (1280, "light")])
def test_nothing_is_cut_off(tmp_path: Path, width: int, scheme: str) -> None:
    chromium = needs.program("chromium", "tests/page/install-browser.sh")
    from playwright.sync_api import sync_playwright

    sentence = "The thermal screen leaves a gap of 4 % when it is closed."
    rows = [
        SiteRow("old-mill", 90, (LONG, "silent for 3 days"), None, "", "", None, None, None, None, None),
        SiteRow("north-7", 50, ("finding",), NOW, "20260201T000000Z", sentence, 42.0, 0.5, 0.43, NOW, None),
    ]
    page = write_page(tmp_path, rows, NOW)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        tab = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)  # type: ignore[arg-type]
        tab.goto(page.as_uri())
        seen = tab.evaluate(
            "(({scrollWidth, clientWidth}) => [scrollWidth, clientWidth])(document.querySelector('.scroll'))"
        )
        names = [one.inner_text() for one in tab.query_selector_all("td.site")]
        browser.close()
    assert seen[0] <= seen[1]
    assert names == ["old-mill", "north-7"]
