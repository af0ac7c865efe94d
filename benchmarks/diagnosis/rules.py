"""The rules of a diagnosis: those that commands have fitted, written with their provenance, and all of them printed."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, fields
from importlib.resources import files
from pathlib import Path
from typing import Any

from igrow.trainer.diagnosis import DEFAULT
from igrow.trainer.diagnosis.rules import FILE, DecisionRules

RULES = Path(str(files("igrow.trainer.diagnosis"))) / FILE


def fitted_names() -> tuple[str, ...]:
    """Return the names of the rules that are fitted."""
    return tuple(one.name for one in fields(DecisionRules) if one.metadata["set"] == "fitted")


def write_rules(path: Path, values: Mapping[str, float], provenance: Mapping[str, Any]) -> None:
    """Write fitted rules, each with its provenance; those that other commands fit stay as they are.

    Raises:
        ValueError: a rule is none that is fitted.
    """
    if not set(values) <= set(fitted_names()):
        raise ValueError(f"fitted rules are {', '.join(fitted_names())}; given were {', '.join(values)}")
    meanings = {one.name: one.metadata["meaning"] for one in fields(DecisionRules)}
    document = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    document |= {name: {"value": values[name], "meaning": meanings[name], **provenance} for name in values}
    path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


def table(rules: DecisionRules) -> list[tuple[str, float, str, str]]:
    """Return (name, value, chosen or fitted, meaning) of every rule."""
    values = asdict(rules)
    return [(one.name, values[one.name], one.metadata["set"], one.metadata["meaning"]) for one in fields(rules)]


def show() -> int:
    """Print every rule with its value, whether it was chosen or fitted, and its meaning."""
    for name, value, how, meaning in table(DEFAULT):
        print(f"{name:30} {value:8g}  {how:7} {meaning}")
    print()
    for name, one in json.loads(RULES.read_text(encoding="utf-8")).items():
        source = one.get("source") or f"seeds {one.get('seeds')}"
        print(f"{name}: {one['command'] or 'no command'}, {one['date']}; {source}")
    return 0
