"""The yield stage of the planning graph: a scan over days, on the means of each day's hours."""

from __future__ import annotations

from onnx import GraphProto

from igrow.core.quantities import GROWTH, YIELD
from igrow.core.simulator.plan import CLIMATE_OUT
from igrow.trainer.exporting.blocks import Block, tagged
from igrow.trainer.exporting.wiring import Wiring

_HOURLY = (*CLIMATE_OUT, *GROWTH)
_CARRIED = (*YIELD, "net_growth")
"""What a day hands to the next."""


def wire_days(outer: Wiring, harvest: Block, climate_out: str, growth_out: str) -> str:
    """Wire the yield of each day, (days, quantities, batch).

    Args:
        outer: the planning graph, with its inputs `harvest` and `growth`.
        harvest: one step of yield.
        climate_out: tensor (hours, `CLIMATE_OUT`, batch).
        growth_out: tensor (hours, `GROWTH`, batch).
    """
    (both,) = outer.add("Concat", [climate_out, growth_out], axis=1)
    shape = outer.add("Shape", [both], start=2, end=3)
    (target,) = outer.add("Concat", [outer.constant("day_shape", [-1, 24, len(_HOURLY)]), *shape], axis=0)
    (days,) = outer.add("Reshape", [both, target])
    (means,) = outer.add("ReduceMean", [days, outer.constant("axis", [1])], keepdims=0)
    (lasts,) = outer.add("Gather", [days, outer.constant("last", [23])], axis=1)
    (lasts,) = outer.add("Squeeze", [lasts, outer.constant("axis", [1])])
    start = outer.matrix([*outer.rows("harvest", YIELD).values(), outer.rows("growth", GROWTH)["net_growth"]])
    _, harvested = outer.add("Scan", [start, means, lasts], 2, body=_day_graph(harvest), num_scan_inputs=2)
    return harvested


def _day_graph(block: Block) -> GraphProto:
    """Return the body of the scan over days."""
    wiring = Wiring("day")
    mean = wiring.rows("day_mean", _HOURLY)
    last = wiring.rows("day_last", _HOURLY)
    carried = wiring.rows("day_carried", _CARRIED)
    (grown,) = wiring.add("Sub", [last["net_growth"], carried["net_growth"]])
    drivers = mean | {"growth_of_day": grown}
    harvest = wiring.call(block, tagged("driver", drivers) | tagged("state", {name: carried[name] for name in YIELD}))
    wiring.output("day_carried_next", wiring.matrix([*(harvest[name] for name in YIELD), last["net_growth"]]))
    wiring.output("day_out", wiring.matrix(list(harvest.values())))
    hourly, following = (len(_HOURLY), "batch"), (len(_CARRIED), "batch")
    return wiring.graph(
        "day",
        {"day_carried": following, "day_mean": hourly, "day_last": hourly},
        {"day_carried_next": following, "day_out": (len(YIELD), "batch")},
    )
