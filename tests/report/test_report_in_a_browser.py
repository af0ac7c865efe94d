"""The report in a real browser: on a phone and a desk, by light and in the dark, for everybody."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, sync_playwright

from igrow.trainer.diagnosis import Diagnosis
from igrow.trainer.report import render_report
from tests import needs


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    chromium = needs.program("chromium", "tests/page/install-browser.sh")
    with sync_playwright() as run:
        one = run.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        yield one
        one.close()


@pytest.fixture(scope="module")
def texts(page_in: Callable[[str], str], stuck: Diagnosis) -> dict[str, str]:
    """A report with causes, and one of a data fault."""
    return {"leak": page_in("nl"), "stuck": render_report(stuck)}


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [390, 1280])
def test_a_report_reads_well(browser: Browser, texts: dict[str, str], tmp_path: Path, width: int, scheme: Any) -> None:
    for name, text in texts.items():
        (tmp_path / f"{name}.html").write_text(text, encoding="utf-8")
        page = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)
        asked: list[str] = []
        page.on("request", lambda request: asked.append(request.url))  # noqa: B023  (each page is closed in its turn)
        page.goto(f"file://{tmp_path / name}.html")
        assert len(asked) == 1, "a report fetches nothing"
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        # Rows of a table may be scrolled to; sentences are seen whole.
        sentences = "[...document.querySelectorAll('p, li, caption, figcaption, h1, h2, h3')]"
        assert page.evaluate(f"Math.max(...{sentences}.map(one => one.getBoundingClientRect().right))") <= width
        smallest = page.evaluate(
            "Math.min(...[...document.querySelectorAll('svg text')].map(one =>"
            " parseFloat(getComputedStyle(one).fontSize) * one.ownerSVGElement.getBoundingClientRect().width"
            " / one.ownerSVGElement.viewBox.baseVal.width))"
        )
        assert smallest > 9.0
        found = Axe().run(page)
        assert found.violations_count == 0, found.generate_report()
        page.close()
