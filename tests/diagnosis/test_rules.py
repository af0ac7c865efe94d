"""Every threshold stands in one place, says what it means, and whether it was chosen or fitted."""

from __future__ import annotations

import ast
import json
from dataclasses import FrozenInstanceError, fields, replace
from pathlib import Path

import pytest

import igrow.trainer.diagnosis
from benchmarks.diagnosis.rules import RULES, fitted_names, table, write_rules
from igrow.trainer.diagnosis.rules import DEFAULT, DecisionRules

FOLDER = Path(igrow.trainer.diagnosis.__file__).parent


def test_every_rule_has_a_meaning_and_is_used() -> None:
    sources = "".join(path.read_text() for path in FOLDER.rglob("*.py") if path.name != "rules.py")
    own = (FOLDER / "rules.py").read_text()
    for name, _, how, meaning in table(DEFAULT):
        assert len(meaning) > 5
        assert how in {"chosen", "fitted", "set on tuning greenhouses"}
        assert f"rules.{name}" in sources or f"self.{name}" in own, f"{name} is not used"


def test_rules_cannot_be_changed_but_replaced() -> None:
    with pytest.raises(FrozenInstanceError):
        DEFAULT.least_omission_fall = 1.0  # type: ignore[misc]
    assert replace(DEFAULT, least_omission_fall=1.0).least_omission_fall == 1.0


def test_fitted_rules_are_stored_each_with_where_it_comes_from() -> None:
    stored = json.loads(RULES.read_text())
    assert set(stored) == set(fitted_names())
    for name, one in stored.items():
        assert one["value"] == getattr(DEFAULT, name)
        assert {"command", "date"} <= set(one)


def test_rules_are_written_each_with_its_meaning(tmp_path: Path) -> None:
    values = {name: 10.0 + number for number, name in enumerate(fitted_names())}
    write_rules(tmp_path / "rules.json", values, {"command": "make them", "date": "2026-01-01", "seeds": 3})
    stored = json.loads((tmp_path / "rules.json").read_text())
    assert {name: one["value"] for name, one in stored.items()} == values
    assert stored["least_omission_fall"]["command"] == "make them"
    assert [one["meaning"] for one in stored.values()] == [row[3] for row in table(DEFAULT) if row[0] in stored]


def test_a_fit_leaves_the_rules_of_other_commands_as_they_are(tmp_path: Path) -> None:
    before = dict.fromkeys(fitted_names(), 1.0)
    write_rules(tmp_path / "rules.json", before, {"command": "make them"})
    write_rules(tmp_path / "rules.json", {"least_omission_fall": 2.0}, {"command": "make one"})
    stored = json.loads((tmp_path / "rules.json").read_text())
    assert {name: one["value"] for name, one in stored.items()} == {**before, "least_omission_fall": 2.0}
    assert stored["least_omission_fall"]["command"] == "make one"


def test_a_fit_of_a_rule_that_is_chosen_is_refused(tmp_path: Path) -> None:
    everything = dict.fromkeys((one.name for one in fields(DecisionRules)), 1.0)
    with pytest.raises(ValueError, match="fitted rules are"):
        write_rules(tmp_path / "rules.json", everything, {})


def test_no_stage_keeps_a_threshold_of_its_own() -> None:
    """Numbers in comparisons of the deciding stages are 0, 1 or tiny: all others are rules."""
    searching = ("search/change", "search/estimate", "search/scan")
    for name in ("circumstances", *searching, "validation/correction", "validation/parameter_or_causes", "diagnose"):
        tree = ast.parse((FOLDER / f"{name}.py").read_text())
        for node in ast.walk(tree):
            if isinstance(node, ast.Compare):
                numbers = [
                    part.value
                    for part in ast.walk(node)
                    if isinstance(part, ast.Constant) and isinstance(part.value, int | float)
                ]
                # A parabola needs three points, a likelihood ratio is half of chi-squared; guards are tiny.
                assert all(abs(number) <= 1e-5 or number in (0.5, 1, 3) for number in numbers), (
                    name,
                    node.lineno,
                    numbers,
                )
