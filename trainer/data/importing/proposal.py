"""From a file to its mapping: laid out so, these columns are these quantities, and this only the user knows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from igrow.core.errors import IgrowError
from igrow.core.quantities import QUANTITIES
from igrow.core.site import Site
from igrow.trainer.data import vocabulary
from igrow.trainer.data.export import readings
from igrow.trainer.data.export_table import ExportTable, chosen_rows
from igrow.trainer.data.importing import columns as names
from igrow.trainer.data.importing.capacity import add_lamp_power, by_capacity
from igrow.trainer.data.importing.compartments import chosen_compartment, rows_of_one
from igrow.trainer.data.importing.error_codes import MEASURED, error_codes
from igrow.trainer.data.importing.folder import cells_like, head_of, joined, table_of, whole
from igrow.trainer.data.importing.layout import Layout, find_layout
from igrow.trainer.data.importing.long_table import find_long, units_beside
from igrow.trainer.data.importing.odd_times import what_is_odd
from igrow.trainer.data.importing.question import Answers, Question
from igrow.trainer.data.importing.sheets import unread
from igrow.trainer.data.importing.texts import ColumnTexts, column_texts
from igrow.trainer.data.importing.time_format import TimeForm, find_time
from igrow.trainer.data.importing.told_units import like_the_others, unit_of_cells
from igrow.trainer.data.importing.zone import find_zone, zones_asked
from igrow.trainer.data.mapping import MISSING, ColumnMapping, ExportMapping, LongTable, TimeColumn
from igrow.trainer.data.vocabulary import CLOSURES, OPENINGS, Unit

ORDERS = {"dmy": ("%d", "%m"), "mdy": ("%m", "%d"), "ymd": ("%Y", "%m")}
MUST_BE_RIGHT = ("air_temperature", "outdoor_temperature", "air_humidity", "air_co2", "global_radiation")
"""Quantities of which no column is taken where another would do as well."""


@dataclass(frozen=True)
class Proposal:
    """What was understood of a file."""

    path: Path
    layout: Layout
    mapping: ExportMapping
    tables: tuple[ExportTable, ...]
    """Of the file and of further ones."""
    sheets: tuple[str, ...]
    """Of a workbook that has several, those that are read."""
    units: Mapping[str, str]
    """Quantity -> the unit that its column is taken to be in; empty where nothing tells it."""
    given: frozenset[str]
    """Quantities whose unit the user gave."""
    unused: tuple[str, ...]
    notes: tuple[str, ...]
    questions: tuple[Question, ...]


@dataclass(frozen=True)
class _Body:
    """The readings of a file."""

    table: ExportTable
    labels: Sequence[str]
    long: LongTable | None
    decimal: str

    def texts(self, label: str, quantity: str) -> ColumnTexts:
        """Return what the readings under a label are, which are taken for a quantity."""
        return column_texts(self.cells(label), self.decimal, vocabulary.words_of(quantity))

    def cells(self, label: str) -> Sequence[str]:
        """Return the readings under a label as they are written."""
        if self.long is None:
            return self.table[label]
        names, values = self.table[self.long.name], self.table[self.long.value]
        return [value for name, value in zip(names, values, strict=True) if name == label]


@dataclass
class _Draft:
    """What is gathered on the way."""

    notes: list[str] = field(default_factory=list)
    questions: list[Question] = field(default_factory=list)


def propose(
    path: Path, site: Site | None = None, answers: Answers | None = None, further: Sequence[Path] = ()
) -> Proposal:
    """Return the mapping of an export as far as the file tells it, and what only the user knows.

    Args:
        path: of the file.
        site: the greenhouse, where it is known.
        answers: what the user said.
        further: files of the same layout, such as those of other days (`alike`).

    Raises:
        IgrowError: the file is no table of readings over time.
    """
    answers = answers or Answers()
    draft = _Draft()
    layout, cells = find_layout(path, answers.sheet)
    head, sheets = head_of(cells, layout), {answers.sheet or "": cells}
    if answers.sheet is None:
        layout, sheets = whole(path, layout, cells)
    of_layout = [sheets, *(cells_like(one, layout, head) for one in further)]
    tables = [table_of(one, layout) for found in of_layout for one in found.values()]
    read_sheets = tuple(filter(None, sheets))
    table = joined(tables)
    unit_line = _unit_line(cells.rows, cells.lines, layout, table)
    time = find_time(dict(table.columns))
    odd = what_is_odd(table.columns, time)
    if odd is not None or time is None:
        raise IgrowError(f"{path}: {odd}")
    time = _ordered(time, answers, draft)
    table = readings(table, TimeColumn(time.column, time.time_of_day, time.form))[0]
    long = find_long(table, (time.column, time.time_of_day), layout.decimal)
    if long is not None:
        unit_line = units_beside(table, long)
    only = rows_of_one(table, time, long, answers, draft.questions)
    table = chosen_rows(table, only)
    labels = (
        list(dict.fromkeys(table[long.name]))
        if long is not None
        else [name for name in table.columns if name not in (time.column, time.time_of_day)]
    )
    matches = names.side_by_side(names.find_matches(labels, unit_line))
    compartment = chosen_compartment(matches, answers, draft.questions)
    names.check_given(answers.columns, labels)
    if answers.sheet is None and read_sheets:
        draft.notes += filter(None, [unread(path, read_sheets)])
    body = _Body(table, labels, long, layout.decimal)
    assigned = names.assign(matches, compartment, answers.columns)
    mapped, units = _mapped(body, assigned, site, answers, draft)
    zone, why = find_zone(time, table, site, answers.time_zone)
    shared = zones_asked(time, table) if zone is None else ()
    if zone is None:
        choices = shared or ("Europe/Amsterdam", "UTC")
        text = "in which time zone are its times?"
        draft.questions.append(Question("time_zone", text, choices, f"--time-zone {choices[0]}", blocks=True))
    if why:
        draft.notes.append(why)
    if "air_humidity" not in mapped:
        draft.notes += [
            f"{column!r} tells the humidity in another way, which is not read: export the relative humidity in %"
            for column in names.of_other_humidity(labels)
        ]
    draft.notes += [
        f"{column!r} is in {unit!r}, which is not known: left out (--column QUANTITY={column!r} takes it as it is)"
        for column, unit in names.of_unknown_unit(labels, unit_line).items()
        if column not in answers.columns.values()
    ]
    marks = _marks(body, mapped)
    if marks:
        draft.notes.append(f"taken for no reading: {', '.join(map(repr, marks[:6]))}" + ", ..." * (len(marks) > 6))
    mapping = ExportMapping(
        columns=mapped,
        time=TimeColumn(time.column, time.time_of_day, time.form, zone or next(iter(shared), "UTC")),
        delimiter=layout.delimiter,
        decimal=layout.decimal,
        missing=(*MISSING, *marks),
        encoding=layout.encoding,
        sheet=layout.sheet,
        header=layout.header,
        first_row=layout.first_row if layout.first_row != max(layout.header) + 1 else None,
        transposed=layout.transposed,
        only=only,
        long=long,
    )
    read = {one for rule in mapped.values() for one in (rule.column, *rule.add)}
    unused = tuple(name for name in labels if name not in read and name not in only)
    return Proposal(
        path,
        layout,
        mapping,
        tuple(tables),
        read_sheets,
        units,
        frozenset(answers.units),
        unused,
        tuple(draft.notes),
        tuple(draft.questions),
    )


def _unit_line(
    rows: Sequence[Sequence[str]], lines: Sequence[int], layout: Layout, table: ExportTable
) -> dict[str, str]:
    """Return column -> unit, of a file with a line of units."""
    if layout.units is None:
        return {}
    row = rows[list(lines).index(layout.units)]
    return dict(zip(table.columns, row, strict=False))


def _ordered(time: TimeForm, answers: Answers, draft: _Draft) -> TimeForm:
    """Return the time in the order of day and month that the user gives, or asks for it where none is likelier."""
    forms = (time.form, *time.alternatives)
    if answers.date_order is not None:
        first = ORDERS[answers.date_order][0]
        chosen = next((form for form in forms if form.startswith(first)), None)
        if chosen is None:
            raise IgrowError(f"the times do not read as {answers.date_order}: they are of the form {time.form}")
        return replace(time, form=chosen, alternatives=())
    if time.alternatives:
        orders = tuple(order for order, parts in ORDERS.items() if any(form.startswith(parts[0]) for form in forms))
        text = "does the day or the month come first in its dates?"
        draft.questions.append(Question("date_order", text, orders, "--date-order dmy", blocks=True))
    return time


def _mapped(
    body: _Body, assigned: names.Assignment, site: Site | None, answers: Answers, draft: _Draft
) -> tuple[dict[str, ColumnMapping], dict[str, str]]:
    """Return the rule of each quantity, and the units that they are taken to be in."""
    rules: dict[str, ColumnMapping] = {}
    units: dict[str, str] = {}
    for quantity in QUANTITIES:
        match = assigned.chosen.get(quantity)
        if match is None:
            continue
        texts = body.texts(match.column, quantity)
        if texts.numeric + texts.missing < 0.5 and not texts.words:
            draft.notes.append(f"{match.column!r} was taken for {quantity}, but its cells are no numbers: left out")
            continue
        if quantity in answers.units:
            unit: Unit | None = names.unit_called(quantity, answers.units[quantity])
        else:
            unit = match.unit or unit_of_cells(quantity, texts.unit)
        rule = ColumnMapping(match.column, words=texts.words)
        if unit is not None:
            scale, amount, offset = unit.scale, unit.amount, unit.offset
            if quantity == "global_radiation" and "sum" in vocabulary.words_in(match.column) and amount == "interval":
                amount = "day"
            rule = replace(rule, scale=scale, offset=offset, amount=amount)
        elif quantity in (*OPENINGS, *CLOSURES) and texts.steps:
            _ask_unit(quantity, match.column, draft, ("percent", f"0-{texts.highest:.0f}"))
            continue
        elif names.dimension(quantity) in ("dose", "water", "power"):
            rescued = by_capacity(quantity, rule, texts.highest, site)
            if rescued is None:
                _ask_unit(quantity, match.column, draft)
                continue
            rule = rescued
            draft.notes.append(f"{match.column!r} has no unit: taken for a switch, times what the site can do at most")
        rules[quantity] = rule
        units[quantity] = unit.name if unit is not None else ""
        rivals = assigned.rivals.get(quantity, ())
        if rivals and quantity in MUST_BE_RIGHT:
            question, columns = f"which column is the {quantity}?", (match.column, *rivals)
            option = f"--column {quantity}={match.column!r}"
            draft.questions.append(Question(f"columns:{quantity}", question, columns, option, blocks=True))
        for rival in rivals:
            draft.notes.append(f"{rival!r} would do for {quantity} as well: --column {quantity}={rival!r} takes it")
    rules, units, told = like_the_others(rules, units)
    draft.notes += told
    draft.notes += filter(None, [add_lamp_power(rules, units, site)])
    for quantity in ("air_temperature", "outdoor_temperature"):
        if quantity not in rules and not any(one.about == f"columns:{quantity}" for one in draft.questions):
            taken = {rule.column for rule in rules.values()}
            left = tuple(name for name in body.labels if name not in taken)[:40]
            text = f"which column is the {quantity}, or in which other file does it stand?"
            draft.questions.append(Question(f"columns:{quantity}", text, left, f"--column {quantity}=NAME"))
    return rules, units


def _ask_unit(quantity: str, column: str, draft: _Draft, known: tuple[str, ...] = ()) -> None:
    known = known or tuple(dict.fromkeys(unit.name for unit in vocabulary.units()[names.dimension(quantity)].values()))
    option = f"--unit {quantity}={known[0]!r}"
    draft.questions.append(Question(f"units:{quantity}", f"in which unit is {column!r} ({quantity})?", known, option))


def _marks(body: _Body, rules: Mapping[str, ColumnMapping]) -> tuple[str, ...]:
    """Return the texts in mapped columns that are no reading: neither numbers nor words, or numbers for a fault."""
    found = dict.fromkeys(mark for quantity, rule in rules.items() for mark in body.texts(rule.column, quantity).marks)
    for quantity, rule in rules.items():
        if quantity in MEASURED:
            found |= dict.fromkeys(error_codes(body.cells(rule.column), body.decimal))
    return tuple(mark for mark in found if mark not in MISSING)
