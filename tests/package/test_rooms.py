"""The rooms of docs/architecture.md: who may import whom."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
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


def names_imported(folder: str) -> Iterator[tuple[str, str]]:
    """Yield each module's path with the path of every module of igrow that it imports, type checkers' ones too."""
    packages = {"igrow.core": "igrow_core", "igrow.edge": "edge", "igrow.trainer": "trainer"}
    for path in (ROOT / folder).rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.ImportFrom) or not node.module or not node.module.startswith("igrow."):
                continue
            package, *inside = node.module.split(".")[1:]
            parent = Path(packages[f"igrow.{package}"], *inside)
            for alias in node.names:
                found = [parent / alias.name, parent]
                module = next(one for one in found if (ROOT / one).is_dir() or (ROOT / f"{one}.py").is_file())
                yield str(path.relative_to(ROOT)), str(module)


def neighbours(folder: str) -> dict[tuple[str, ...], dict[str, set[str]]]:
    """Return for each folder in a room what stands in it, modules and folders, and which of these each one imports."""
    found: dict[tuple[str, ...], dict[str, set[str]]] = {}
    for place, module in names_imported(folder):
        ours, theirs = Path(place).with_suffix("").parts, Path(module).parts
        shared = next((k for k, (a, b) in enumerate(zip(ours, theirs, strict=False)) if a != b), None)
        if shared and ours[shared] != "__init__":
            found.setdefault(ours[:shared], {}).setdefault(ours[shared], set()).add(theirs[shared])
    return found


@pytest.mark.parametrize("room", BARRED)
def test_no_two_that_stand_side_by_side_import_each_other_in_a_circle(room: str) -> None:
    """Whoever reads goes in one direction, within a function or for a type checker too: a module, a folder, a room."""
    circles = {}
    for folder, above in neighbours(room).items():
        try:
            TopologicalSorter(above).prepare()
        except CycleError as error:
            circles["/".join(folder)] = error.args[1]
    assert not circles


def test_the_road_of_the_trainer_leads_through_its_rooms_in_order() -> None:
    order = list(TopologicalSorter(neighbours("trainer")["trainer",]).static_order())
    road = ("data", "fit", "diagnosis", "calibration", "service", "fleet", "cli")
    assert sorted(road, key=order.index) == list(road)
