"""`igrow-edge model list` says which bundle is at which step."""

from __future__ import annotations

from pathlib import Path

import pytest

from igrow.edge.cli import main
from igrow.edge.updates.state import UpdateState, save_state
from tests.tiny_bundle import write_tiny_bundle

ROOT = Path(__file__).resolve().parents[2]


def test_each_bundle_has_its_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "daemon.yaml"
    path.write_text(
        f"site: {ROOT}/config/site.yaml\nregister_map: {ROOT}/config/register-maps/virtual-plc.yaml\nstate: state\n"
    )
    assert main(["model", "list", str(path)]) == 0
    assert "no bundle" in capsys.readouterr().out
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
