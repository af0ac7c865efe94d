"""What tests of reading logs share."""

from __future__ import annotations

import pytest

from igrow.trainer.data import Log


@pytest.fixture
def without_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let an import draw no picture of its log, which takes many times as long as the rest of it."""
    monkeypatch.setattr(Log, "plot", lambda *_: None)
