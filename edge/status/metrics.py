"""The snapshot in the Prometheus text format, with the units that its naming rules ask for."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from igrow.core.quantities import QUANTITIES
from igrow.edge.ports import Snapshot

Sample = tuple[Mapping[str, str], float | None]


def render_metrics(snapshot: Snapshot) -> str:
    """Return all metrics; a value that is not known is left out."""
    plan, bundle = snapshot.plan, snapshot.bundle
    live = bundle.get("live_errors")
    lines: list[str] = []

    def metric(name: str, kind: str, text: str, samples: Iterable[Sample]) -> None:
        kept = [(labels, value) for labels, value in samples if value is not None and math.isfinite(value)]
        if kept:
            lines.extend([f"# HELP igrow_{name} {text}", f"# TYPE igrow_{name} {kind}"])
            lines.extend(f"igrow_{name}{_labels(labels)} {value:.10g}" for labels, value in kept)

    metric("cycles_total", "counter", "Completed control cycles since the start.", [({}, snapshot.cycle)])
    metric("cycle_seconds", "gauge", "Own work of the last control cycle.", [({}, snapshot.cycle_seconds)])
    metric("plc_link_up", "gauge", "1 while the PLC answers.", [({}, float(snapshot.link_ok))])
    metric("clock_ok", "gauge", "1 while the date can be trusted.", [({}, float(snapshot.clock_ok))])
    metric("source_info", "gauge", "Source that decides most setpoints now.", [({"source": snapshot.source}, 1.0)])
    metric(
        "value",
        "gauge",
        "Last value of each point, in the unit of its label.",
        [({"point": name, "unit": _unit(name)}, value.value) for name, value in snapshot.values.items()],
    )
    metric(
        "value_good",
        "gauge",
        "1 while the value may be believed.",
        [({"point": name}, float(value.quality.value == "good")) for name, value in snapshot.values.items()],
    )
    metric(
        "value_age_seconds",
        "gauge",
        "Age of each value.",
        [({"point": name}, value.age) for name, value in snapshot.values.items()],
    )
    for field in ("requested", "applied", "shown"):
        metric(
            f"setpoint_{field}",
            "gauge",
            f"Setpoint as it was {field}, in the unit of its label.",
            [
                ({"setpoint": name, "unit": _unit(name)}, getattr(setpoint, field))
                for name, setpoint in snapshot.setpoints.items()
            ],
        )
    metric("alarms_active", "gauge", "Active alarms.", [({}, float(len(snapshot.alarms)))])
    metric("alarm", "gauge", "1 for each active alarm.", [({"name": a.name}, 1.0) for a in snapshot.alarms])
    metric("problems", "gauge", "Services that report themselves unwell.", [({}, float(len(snapshot.problems)))])
    metric(
        "writes_left",
        "gauge",
        "Writes left today to registers that wear out.",
        [({"point": name}, float(left)) for name, left in snapshot.writes_left.items()],
    )
    if plan is not None:
        metric("plan_profit", "gauge", "Expected profit of the plan, EUR per m2.", [({}, plan.expected_profit)])
        metric("recipe_profit", "gauge", "Expected profit of the recipe, EUR per m2.", [({}, plan.recipe_profit)])
        metric(
            "plan_leaves_range", "gauge", "1 if the plan leaves the training range.", [({}, float(plan.leaves_range))]
        )
        metric("plan_valid_until_seconds", "gauge", "End of the plan, seconds since 1970.", [({}, plan.valid_until)])
    metric(
        "bundle_info",
        "gauge",
        "The bundle in force.",
        [({"bundle": str(bundle["name"])}, 1.0)] if bundle.get("name") else [],
    )
    if isinstance(live, Mapping):
        samples: list[Sample] = []
        for key, error in live.items():
            quantity, _, horizon = str(key).partition(" ")
            samples.append(({"quantity": quantity, "horizon": horizon, "unit": _unit(quantity)}, float(error)))
        metric("live_error", "gauge", "Mean absolute error of the simulator on the last day.", samples)
    return "\n".join(lines) + "\n"


def _unit(name: str) -> str:
    return QUANTITIES[name].unit if name in QUANTITIES else ""


def _labels(labels: Mapping[str, str]) -> str:
    if not labels:
        return ""
    escaped = (
        (key, value.replace("\\", r"\\").replace('"', r"\"").replace("\n", r"\n")) for key, value in labels.items()
    )
    return "{" + ",".join(f'{key}="{value}"' for key, value in escaped) + "}"
