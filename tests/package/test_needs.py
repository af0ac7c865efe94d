"""A test that lacks its program says what to install, and under CI it does not pass for tested."""

from __future__ import annotations

import pytest

from tests import needs


def test_an_absent_program_is_a_skip_that_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CI", raising=False)
    with pytest.raises(pytest.skip.Exception, match=r"no-such-program is absent.*sh tests/peers/install.sh"):
        needs.program("no-such-program", "tests/peers/install.sh")


def test_under_ci_an_absent_program_or_file_is_a_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CI", "true")
    with pytest.raises(pytest.fail.Exception, match="no-such-program is absent"):
        needs.program("no-such-program", "tests/peers/install.sh")
    with pytest.raises(pytest.fail.Exception, match="unit-test-server is absent"):
        needs.file(needs.ROOT / "no" / "unit-test-server", "tests/peers/install.sh")


def test_absent_data_sets_are_a_skip_under_ci_as_well(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CI", "true")
    monkeypatch.setenv("IGROW_DATA", "/no/such/folder")
    with pytest.raises(pytest.skip.Exception, match="IGROW_DATA"):
        needs.data_sets()
