"""The rooms of docs/architecture.md: who may import whom."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
HEAVY = ("torch", "scipy", "pandas", "pyarrow", "onnx", "ndonnx", "matplotlib")
"""What a gateway has not."""
BARRED = {
    "igrow_core": ("igrow.edge", "igrow.trainer", *HEAVY),
    "edge": ("igrow.trainer", *HEAVY),
    "trainer": ("igrow.edge",),
}
SCORES_BOTH_VARIANTS = "trainer/scoring/bundles.py"


def imports(folder: str) -> Iterator[tuple[str, str]]:
    """Yield each module's path with a module that it imports, at its top or within a function."""
    for path in (ROOT / folder).rglob("*.py"):
        place = str(path.relative_to(ROOT))
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module:
                yield place, node.module
            elif isinstance(node, ast.Import):
                yield from ((place, alias.name) for alias in node.names)


@pytest.mark.parametrize("room", BARRED)
def test_a_room_imports_no_other_that_it_may_not(room: str) -> None:
    found = {
        (place, name)
        for place, name in imports(room)
        if any(name == other or name.startswith(f"{other}.") for other in BARRED[room])
    }
    assert not found


def test_the_road_imports_no_research_but_to_score_bundles_of_the_network_variant() -> None:
    found = {
        place
        for place, name in imports("trainer")
        if name.startswith("igrow.trainer.research") and not place.startswith("trainer/research/")
    }
    assert found == {SCORES_BOTH_VARIANTS}


def test_the_rooms_of_the_trainer_stand_above_each_other() -> None:
    """No room imports one that needs it in turn, within a function or not: whoever reads goes in one direction."""
    above: dict[str, set[str]] = {}
    for place, name in imports("trainer"):
        room, other = place.split("/")[1].removesuffix(".py"), name.removeprefix("igrow.trainer.").split(".")[0]
        if name.startswith("igrow.trainer.") and room not in (other, "__init__"):
            above.setdefault(room, set()).add(other)
    order = list(TopologicalSorter(above).static_order())
    road = ("data", "fit", "diagnosis", "calibration", "service", "fleet", "cli")
    assert sorted(road, key=order.index) == list(road)
