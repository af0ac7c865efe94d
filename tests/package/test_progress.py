"""Long work shows at a terminal how far it is, and is quiet elsewhere."""

from __future__ import annotations

import io
import sys

import numpy as np
import pytest

from igrow.trainer.cli import main
from igrow.trainer.cli.progress import days_done, progress


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_each_step_is_shown_at_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Terminal()
    monkeypatch.setattr(sys, "stderr", screen)
    with progress("calibrating") as say:
        say("reading the rules of the PLC")
    assert "calibrating: reading the rules of the PLC [00:" in screen.getvalue()


def test_days_are_counted_at_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Terminal()
    monkeypatch.setattr(sys, "stderr", screen)
    start = np.datetime64("2020-02-01T00:00:00")
    with days_done("simulating", start, start + np.timedelta64(4, "D")) as reached:
        reached(start + np.timedelta64(36, "h"))
        reached(start + np.timedelta64(4, "D"))
    assert "simulating: 100%" in screen.getvalue()
    assert "4/4 days" in screen.getvalue()


def test_nothing_is_shown_elsewhere(tmp_path, capsys: pytest.CaptureFixture[str]) -> None:
    site = tmp_path / "site.yaml"
    site.write_text("name: virtual\nlatitude: 52.0\nlongitude: 4.5\n")
    with progress("diagnosing") as say:
        say("searching")
    assert main(["generate", "--site", str(site), "--days", "1", "--out", str(tmp_path / "out")]) == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    assert printed.out.count("\n") == 1
