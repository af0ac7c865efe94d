"""`igrow-edge model`: which bundle is at which step, and the operator's word on it."""

from __future__ import annotations

from pathlib import Path

import pytest

from igrow.edge.cli import main
from igrow.edge.updates.state import UpdateState, save_state
from tests.tiny_bundle import write_tiny_bundle

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "daemon.yaml"
    path.write_text(
        f"site: {ROOT}/config/site.yaml\nregister_map: {ROOT}/config/register-maps/virtual-plc.yaml\nstate: state\n"
    )
    return path


def test_each_bundle_has_its_line(tmp_path: Path, path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shelf = tmp_path / "state" / "updates" / "bundles"
    shelf.mkdir(parents=True)
    made = [write_tiny_bundle(tmp_path / str(offset), offset=offset) for offset in (5.0, 6.0)]
    for bundle in made:
        bundle.folder.rename(shelf / bundle.identity)
    state = UpdateState(active=made[0].identity, previous="gone", candidate=made[1].identity, watch_since=1.0)
    state.rejected["bad"] = "worse in the shadow run"
    save_state(tmp_path / "state" / "updates" / "state.json", state)
    assert main(["model", "list", str(path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith(f"in force, on probation  {made[0].identity}  demo-20260314-")
    assert lines[1].startswith(f"in the shadow           {made[1].identity}")
    assert lines[2].startswith("previous                gone")
    assert lines[3] == "refused                 bad  worse in the shadow run"


@pytest.mark.parametrize(
    ("bundle", "said"),
    [
        ("built_in", "no bundle yet: the daemon begins with the one in "),
        ("null", "no bundle: the grower's recipe rules"),
    ],
)
def test_before_the_daemon_first_starts_it_is_said_what_it_will_begin_with(
    path: Path, capsys: pytest.CaptureFixture[str], bundle: str, said: str
) -> None:
    path.write_text(f"{path.read_text()}bundle: {bundle}\n")
    assert main(["model", "list", str(path)]) == 0
    assert capsys.readouterr().out.startswith(said)


def test_what_is_pinned_or_to_go_back_is_shown_before_the_daemon_has_done_it(
    tmp_path: Path, path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "state" / "updates"
    folder.mkdir(parents=True)
    save_state(folder / "state.json", UpdateState(active="new", previous="old", watch_since=1.0))
    for action, said, shown in (
        ("pin", "new is pinned: no update replaces it", "in force, pinned"),
        ("unpin", "new is not pinned: the next update may replace it, after its shadow run", "in force, on probation"),
        ("back", "old takes the place of new as soon as the daemon runs its next cycles", "in force, to go back"),
    ):
        assert main(["model", action, str(path)]) == 0
        assert capsys.readouterr().out == said + "\n"
        assert main(["model", "list", str(path)]) == 0
        assert capsys.readouterr().out.startswith(f"{shown:<22}  new  ")


@pytest.mark.parametrize(
    ("action", "state", "said"),
    [
        ("pin", UpdateState(), "no bundle is in force, so there is none to pin"),
        ("back", UpdateState(active="new"), "there is no earlier bundle on this gateway to go back to"),
    ],
)
def test_a_wish_that_cannot_be_fulfilled_is_refused_in_one_line(
    tmp_path: Path, path: Path, capsys: pytest.CaptureFixture[str], action: str, state: UpdateState, said: str
) -> None:
    folder = tmp_path / "state" / "updates"
    folder.mkdir(parents=True)
    save_state(folder / "state.json", state)
    assert main(["model", action, str(path)]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


def test_a_gateway_that_never_ran_is_left_as_it_is(
    tmp_path: Path, path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["model", "unpin", str(path)]) == 2
    assert "the daemon makes it when it first starts" in capsys.readouterr().err
    assert not (tmp_path / "state").exists()
