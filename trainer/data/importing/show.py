"""What was understood of an export, in lines for people, and its mapping as a file."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import fields

import numpy as np

from igrow.core.quantities import CLIMATE, QUANTITIES, WEATHER
from igrow.trainer.data.cells import is_text
from igrow.trainer.data.grid import own_step
from igrow.trainer.data.importing.check import Checked
from igrow.trainer.data.importing.proposal import Proposal
from igrow.trainer.data.log import Log
from igrow.trainer.data.mapping import MISSING, ColumnMapping, ExportMapping, TimeColumn

_ROWS = 3
_RARE = ("sky_temperature", "outdoor_co2", "par")
"""Weather and climate that few greenhouses measure."""


def understood(proposal: Proposal, checked: Checked) -> list[str]:
    """Return what was understood, with the first rows, in lines."""
    table, layout, mapping = checked.merged.telemetry, proposal.layout, checked.mapping
    first, last = (str(table.time[row]).replace("T", " ")[:16] for row in (0, -1)) if len(table) else ("-", "-")
    step = own_step(table.time) / 60.0
    lines = [f"{proposal.path.name}: {len(table)} rows, {first} to {last} UTC, every {step:g} min"]
    line = "times across, column" if layout.transposed else "line"
    names = f"names in {line} {' and '.join(map(str, layout.header))}"
    units = f", units in {line.rsplit(maxsplit=1)[-1]} {layout.units}" if layout.units else ""
    kind = _kind(proposal)
    lines.append(f"layout: {kind}, decimal {_shown(layout.decimal)}, {names}{units}")
    day = " + ".join(name for name in (mapping.time.column, mapping.time.time_of_day) if name is not None)
    lines.append(f"time: {day!r}, as {mapping.time.format}, in {mapping.time.time_zone}")
    lines += [f"rows: {name} is {text!r}" for name, text in mapping.only.items()]
    lines += ["", f"{'quantity':24}{'column':32}{'unit there':16}{'lowest':>9}{'median':>9}{'highest':>9}  our unit"]
    for quantity, rule in mapping.columns.items():
        values = table[quantity][np.isfinite(table[quantity])]
        spread = [f"{one:9.4g}" for one in np.quantile(values, (0.0, 0.5, 1.0))] if len(values) else ["        -"] * 3
        column = rule.column if len(rule.column) <= 30 else rule.column[:27] + "..."
        unit = _unit_there(proposal, quantity, rule)
        lines.append(f"{quantity:24}{column:32}{unit:16}{''.join(spread)}  {QUANTITIES[quantity].unit}")
    lines += ["", "first rows, in our units:"]
    for row in range(min(_ROWS, len(table))):
        cells = ", ".join(f"{name} {table[name][row]:.4g}" for name in list(mapping.columns)[:8])
        lines.append(f"  {str(table.time[row]).replace('T', ' ')[:16]}  {cells}")
    if proposal.unused:
        lines += ["", "not used: " + ", ".join(proposal.unused)]
    return lines


def aside(log: Log) -> list[str]:
    """Return what was set aside of a log, and which quantities it has no readings of, in lines."""
    lines = [note for note in log.notes if "set aside" in note]
    needed = [name for name in (*WEATHER, *CLIMATE) if name not in _RARE and not QUANTITIES[name].optional]
    lacking = [name for name in needed if name not in log.telemetry or not np.isfinite(log.telemetry[name]).any()]
    if lacking:
        lines.append(f"no readings of {', '.join(lacking)}: nothing is said of what needs them")
    return lines


def _unit_there(proposal: Proposal, quantity: str, rule: ColumnMapping) -> str:
    plain = rule.scale == 1.0 and rule.offset == 0.0 and rule.amount == "rate"
    named = proposal.units.get(quantity, "")
    if named and proposal.mapping.columns.get(quantity) == rule:
        return named
    change = "" if plain else f"x {rule.scale:.4g}" + (f" {rule.offset:+.4g}" if rule.offset else "")
    return change or named or "(as ours)"


def _shown(sign: str) -> str:
    return {" ": "blanks", "\t": "tab", ",": "comma", ";": "semicolon", ".": "point", "|": "bar"}.get(sign, sign)


def as_yaml(mapping: ExportMapping, remarks: Iterable[str] = ()) -> str:
    """Return a mapping as the text of its file; what is at its default is left out."""
    lines = [f"# {remark}" for remark in remarks]
    lines.append(f"time: {_inline(mapping.time, TimeColumn())}")
    plain = ExportMapping({})
    for name in ("delimiter", "decimal", "encoding", "sheet", "transposed", "header", "first_row", "only"):
        value = getattr(mapping, name)
        if value != getattr(plain, name):
            lines.append(f"{name}: {_value(value)}")
    marks = [mark for mark in mapping.missing if mark not in MISSING]
    if marks:
        lines.append(f"missing: {_value(mapping.missing)}")
    if mapping.long is not None:
        lines.append(f"long: {{name: {_value(mapping.long.name)}, value: {_value(mapping.long.value)}}}")
    lines.append("columns:" if mapping.columns else "columns: {}")
    lines += [f"  {quantity}: {_inline(rule, ColumnMapping(''))}" for quantity, rule in mapping.columns.items()]
    return "\n".join(lines) + "\n"


def _inline(one: TimeColumn | ColumnMapping, plain: TimeColumn | ColumnMapping) -> str:
    parts = [
        f"{field.name}: {_value(getattr(one, field.name))}"
        for field in fields(one)
        if getattr(one, field.name) != getattr(plain, field.name)
    ]
    return "{" + ", ".join(parts) + "}"


def _value(value: object) -> str:
    """Return a value as YAML: texts in quotes, so that none is taken for something else."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:.10g}" if value != int(value) else f"{int(value)}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_value(name)}: {_value(one)}" for name, one in value.items()) + "}"
    return json.dumps(value, ensure_ascii=False)


def _kind(proposal: Proposal) -> str:
    """Return which sheets of a workbook are read, or how a text is written."""
    sheets, layout = proposal.sheets, proposal.layout
    if len(sheets) > 1:
        return f"{len(sheets)} sheets, {sheets[0]!r} to {sheets[-1]!r}"
    if sheets:
        return f"sheet {sheets[0]!r}"
    if not is_text(proposal.path):
        return "Parquet" if proposal.path.suffix.lower() == ".parquet" else "a workbook"
    return f"{layout.encoding}, {_shown(layout.delimiter)} between cells"
