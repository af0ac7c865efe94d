"""The page: what is controlled, by whom and why, in the order in which a grower asks."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime, tzinfo
from html import escape

from igrow.core.quantities import QUANTITIES
from igrow.edge.image import Quality
from igrow.edge.ports import Plan, Snapshot
from igrow.edge.status.charts import Line, day_chart, sparkline
from igrow.edge.status.history import History, Series
from igrow.edge.status.style import STYLE

SOURCES = {
    "override": "You control",
    "plan": "The plan controls",
    "last_plan": "The last plan controls",
    "recipe": "Your recipe controls",
    "hands_off": "Hands off: the PLC controls",
}
UNITS = {"degC": "°C", "umol m-2 s-1": "µmol/m²s", "W m-2": "W/m²", "m s-1": "m/s", "1": "", "kg m-2": "kg/m²"}
CLIMATE = ("air_temperature", "air_humidity", "air_co2", "global_radiation")
DIGITS = {"degC": 1, "%": 0, "ppm": 0, "W m-2": 0, "m s-1": 1, "1": 2, "kg m-2 h-1": 4}


def render_page(snapshot: Snapshot, history: History, zone: tzinfo, *, late: bool) -> str:
    """Return the whole page; it loads nothing from anywhere and renews itself."""
    parts = [
        _headline(snapshot, zone, late),
        _troubles(snapshot),
        _climate(snapshot, history),
        _setpoints(snapshot),
        _plan(snapshot, history, zone),
        _model(snapshot.bundle, zone),
        _clamps(snapshot, zone),
        _values(snapshot),
    ]
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<meta http-equiv="refresh" content="15">'
        f"<title>{escape(snapshot.site)} - igrow</title><style>{STYLE}</style></head><body><main>"
        + "".join(parts)
        + f"<footer>Cycle {snapshot.cycle:,}, own work {1000 * snapshot.cycle_seconds:.1f} ms. "
        "For machines: <code>/health</code>, <code>/metrics</code>, <code>/state.json</code>. "
        "This page only shows; it changes nothing.</footer></main></body></html>"
    )


def _headline(snapshot: Snapshot, zone: tzinfo, late: bool) -> str:
    if late:
        pill, text = "bad", "no cycle lately"
    elif not snapshot.link_ok:
        pill, text = "bad", "PLC does not answer"
    elif snapshot.alarms or snapshot.problems:
        pill, text = "warn", "running, with remarks"
    else:
        pill, text = "good", "running"
    moment = "date unknown" if snapshot.time is None else _local(snapshot.time, zone, "%A %d %B %Y, %H:%M")
    return (
        f'<header><div><h1>{escape(snapshot.site)}</h1><p class="quiet">{moment}</p></div>'
        f'<span class="pill {pill}">{text}</span></header>'
        f'<section class="lead"><p class="who">{escape(SOURCES.get(snapshot.source, snapshot.source))}</p>'
        f"<p>{escape(snapshot.why)}</p></section>"
    )


def _troubles(snapshot: Snapshot) -> str:
    lines = [f'<li class="bad">{escape(alarm.text)}</li>' for alarm in snapshot.alarms]
    lines += [f'<li class="warn">{escape(problem)}</li>' for problem in snapshot.problems]
    if not snapshot.clock_ok:
        lines.append('<li class="warn">The date cannot be trusted; plans and updates wait until it can.</li>')
    return f'<section><h2>Attention</h2><ul class="troubles">{"".join(lines)}</ul></section>' if lines else ""


def _climate(snapshot: Snapshot, history: History) -> str:
    cards = []
    for name in CLIMATE:
        value = snapshot.values.get(name)
        if value is None:
            continue
        quantity = QUANTITIES[name]
        good = value.quality is Quality.GOOD
        note = "" if good else f'<span class="tag warn">{value.quality.value.replace("_", " ")}</span>'
        cards.append(
            f'<div class="card"><p class="quiet">{_title(name)} {note}</p>'
            f'<p class="big">{_number(value.value, quantity.unit)}<small> {_unit(quantity.unit)}</small></p>'
            f"{sparkline(history.series(name))}</div>"
        )
    return f'<section class="cards">{"".join(cards)}</section>' if cards else ""


def _setpoints(snapshot: Snapshot) -> str:
    rows = []
    for name, setpoint in snapshot.setpoints.items():
        unit = QUANTITIES[name].unit if name in QUANTITIES else ""
        why = escape(setpoint.why)
        if setpoint.held_until is not None:
            minutes = max(0.0, setpoint.held_until - snapshot.monotonic) / 60.0
            why += f' <span class="tag">changed by hand, respected for {minutes:.0f} min more</span>'
        rows.append(
            [
                f"{_title(name)} <small>{_unit(unit)}</small>",
                _number(setpoint.requested, unit),
                _number(setpoint.applied, unit),
                f"<b>{_number(setpoint.shown, unit)}</b>",
                f'<span class="tag">{escape(setpoint.source.replace("_", " "))}</span>',
                why,
            ]
        )
    table = _table(("Setpoint", "wanted", "written", "PLC shows", "by", "why"), rows, numeric=(1, 2, 3))
    return f"<section><h2>Setpoints</h2>{table}</section>" if rows else ""


def _plan(snapshot: Snapshot, history: History, zone: tzinfo) -> str:
    plan = snapshot.plan
    now = snapshot.time if snapshot.time is not None else 0.0
    chart = day_chart(
        [
            Line("air temperature", history.series("air_temperature"), "measured"),
            Line("expected", _course(plan, "air_temperature", 1.0), "expected"),
            Line(
                "heating setpoint",
                history.series("heating_setpoint") + _course(plan, "heating_setpoint", 0.0, after=now),
                "setpoint",
                stepped=True,
            ),
        ],
        now,
        "°C",
        zone,
    )
    if plan is None:
        text = '<p class="quiet">There is no plan yet; the recipe needs none.</p>'
    else:
        gain = plan.expected_profit - plan.recipe_profit
        money = (
            f'<div class="money"><div><p class="quiet">plan</p><p class="big">{_euro(plan.expected_profit)}</p></div>'
            f'<div><p class="quiet">recipe</p><p class="big">{_euro(plan.recipe_profit)}</p></div>'
            f'<div><p class="quiet">difference</p><p class="big {"up" if gain >= 0 else "down"}">'
            f"{_euro(gain, sign=True)}</p></div></div>"
        )
        remarks = [
            f"Expected over {len(next(iter(plan.setpoints.values()), ())) * plan.step_seconds / 3600:.0f} h, "
            f"EUR per m², by {escape(plan.bundle)}; valid until {_local(plan.valid_until, zone, '%a %H:%M')}."
        ]
        if plan.leaves_range:
            remarks.append('<span class="tag warn">goes beyond what the simulator was trained on</span>')
        if plan.note:
            remarks.append(escape(plan.note) + ".")
        text = f'{money}<p class="quiet">{" ".join(remarks)}</p>'
    return f"<section><h2>Plan against recipe</h2>{text}{chart}</section>"


def _model(bundle: Mapping[str, object], zone: tzinfo) -> str:
    if not bundle.get("name"):
        refusal = f' <span class="tag warn">{escape(str(bundle["refusal"]))}</span>' if bundle.get("refusal") else ""
        return (
            "<section><h2>Simulator</h2>"
            f'<p class="quiet">No bundle is installed, so no plans are made.</p>{refusal}</section>'
        )
    effects = bundle.get("effects") or []
    assert isinstance(effects, Sequence)
    knows = ", ".join(str(effect).replace("_", " ") for effect in effects) or "none beyond the standard balances"
    parts = [f"<p><b>{escape(str(bundle['name']))}</b>. Effects found at this site: {escape(knows)}.</p>"]
    if bundle.get("candidate"):
        until = bundle.get("shadow_until")
        when = f" until {_local(until, zone, '%a %d %b %H:%M')}" if isinstance(until, float | int) else ""
        parts.append(f"<p>{escape(str(bundle['candidate']))} predicts in its shadow{when}.</p>")
    until = bundle.get("probation_until")
    if isinstance(until, float | int):
        parts.append(f"<p>On probation against its predecessor until {_local(until, zone, '%a %d %b %H:%M')}.</p>")
    if bundle.get("last_verdict"):
        parts.append(f'<p class="quiet">{escape(str(bundle["last_verdict"]))}.</p>')
    if bundle.get("refusal"):
        parts.append(f'<p><span class="tag warn">{escape(str(bundle["refusal"]))}</span></p>')
    live = bundle.get("live_errors")
    history = bundle.get("live_error_history")
    if isinstance(live, Mapping) and live:
        rows = []
        for quantity in dict.fromkeys(str(key).split(" ")[0] for key in live):
            unit = QUANTITIES[quantity].unit if quantity in QUANTITIES else ""
            course = _error_course(history, f"{quantity} 24_h")
            rows.append(
                [
                    f"{_title(quantity)} <small>{_unit(unit)}</small>",
                    _error(live.get(f"{quantity} 1_h")),
                    _error(live.get(f"{quantity} 24_h")),
                    sparkline(course, width=220, height=30),
                ]
            )
        heads = ("How wrong it was lately", "1 h ahead", "24 h ahead", "24 h ahead, course")
        parts.append(_table(heads, rows, numeric=(1, 2)))
    return f"<section><h2>Simulator</h2>{''.join(parts)}</section>"


def _clamps(snapshot: Snapshot, zone: tzinfo) -> str:
    rows = [
        [
            "" if record.time is None else _local(record.time, zone, "%a %H:%M"),
            _title(record.point),
            _number(record.requested, _unit_of(record.point)),
            _number(record.applied, _unit_of(record.point)),
            escape(record.reason),
        ]
        for record in list(snapshot.clamps)[:10]
    ]
    body = (
        _table(("when", "point", "wanted", "written", "why"), rows, numeric=(2, 3))
        if rows
        else '<p class="quiet">The guard has changed nothing lately.</p>'
    )
    budgets = ", ".join(f"{_title(name)} {left}" for name, left in snapshot.writes_left.items())
    left = f'<p class="quiet">Writes left today: {budgets}.</p>' if budgets else ""
    return f"<section><h2>What the guard changed</h2>{body}{left}</section>"


def _values(snapshot: Snapshot) -> str:
    rows = []
    for name, value in snapshot.values.items():
        unit = _unit_of(name)
        style = "" if value.quality is Quality.GOOD else " warn"
        age = "" if math.isinf(value.age) else f"{value.age:.0f} s"
        rows.append(
            [
                _title(name),
                f"{_number(value.value, unit)} <small>{_unit(unit)}</small>",
                f'<span class="tag{style}">{value.quality.value.replace("_", " ")}</span> {escape(value.why)}',
                age,
            ]
        )
    bad = sum(value.quality is not Quality.GOOD for value in snapshot.values.values())
    summary = f"All {len(rows)} points" + (f", {bad} not good" if bad else ", all good")
    table = _table(("point", "value", "quality", "age"), rows, numeric=(1, 3))
    return f"<section><details><summary>{summary}</summary>{table}</details></section>" if rows else ""


def _course(plan: Plan | None, name: str, end_of_step: float, after: float = -math.inf) -> Series:
    """Return what a plan holds of a quantity, over time; predictions stand at the end of their step."""
    if plan is None:
        return ()
    values = plan.predicted.get(name) if end_of_step else plan.setpoints.get(name)
    return tuple(
        (plan.start + (step + end_of_step) * plan.step_seconds, value)
        for step, value in enumerate(values or ())
        if plan.start + (step + end_of_step) * plan.step_seconds > after
    )


def _error_course(history: object, key: str) -> Series:
    if not isinstance(history, Sequence):
        return ()
    return tuple((time, errors[key]) for time, errors in history if key in errors)


def _table(heads: Sequence[str], rows: Iterable[Sequence[str]], *, numeric: Sequence[int] = ()) -> str:
    def cells(kind: str, row: Sequence[str]) -> str:
        return "".join(
            f'<{kind} class="number">{cell}</{kind}>' if column in numeric else f"<{kind}>{cell}</{kind}>"
            for column, cell in enumerate(row)
        )

    body = "".join(f"<tr>{cells('td', row)}</tr>" for row in rows)
    return f'<div class="scroll"><table><tr>{cells("th", heads)}</tr>{body}</table></div>'


def _title(name: str) -> str:
    text = escape(name.replace("_", " "))
    return (text[:1].upper() + text[1:]).replace("co2", "CO₂").replace("Co2", "CO₂")


def _unit(unit: str) -> str:
    return escape(UNITS.get(unit, unit))


def _unit_of(name: str) -> str:
    return QUANTITIES[name].unit if name in QUANTITIES else ""


def _number(value: float | None, unit: str) -> str:
    if value is None or not math.isfinite(value):
        return "–"
    return f"{value:.{DIGITS.get(unit, 1)}f}"


def _error(value: object) -> str:
    return f"{value:.2f}" if isinstance(value, float | int) and math.isfinite(value) else "–"


def _euro(value: float, *, sign: bool = False) -> str:
    if not math.isfinite(value):
        return "–"
    return f"{value:{'+' if sign else ''}.3f} €"


def _local(time: float, zone: tzinfo, form: str) -> str:
    return f"{datetime.fromtimestamp(time, zone):{form}}"
