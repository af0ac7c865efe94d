"""The self-test: golden inputs through onnxruntime on this machine must give the golden outputs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from igrow.core.bundle.files import REQUIRED_GRAPHS, Bundle, read_golden
from igrow.core.bundle.manifest import BundleError
from igrow.core.bundle.session import open_session, run_graph


@dataclass(frozen=True)
class Deviation:
    """How far one output lies from its golden value, as a fraction of the largest expected magnitude."""

    graph: str
    output: str
    relative: float


def self_test(bundle: Bundle) -> tuple[Deviation, ...]:
    """Run every graph on its golden inputs and compare.

    Returns the deviation of each output. Raises BundleError at the first output that is not finite where it
    should be, of another shape, or off by more than the manifest's `golden_tolerance`; where a graph has no
    golden values, or other inputs and outputs than the manifest says; and where the manifest leaves out one of
    the graphs that every bundle needs.
    """
    golden = read_golden(bundle)
    if missing := [graph for graph in REQUIRED_GRAPHS if graph not in bundle.manifest.graphs]:
        raise BundleError(f"{bundle.folder}: the manifest does not list {missing[0]}.onnx, so it cannot be tested")
    deviations = []
    for graph, signature in bundle.manifest.graphs.items():
        if graph not in golden:
            raise BundleError(f"{bundle.folder}: no golden values for {graph}.onnx, so it cannot be tested")
        session = open_session(bundle.graph(graph))
        names = [output.name for output in session.get_outputs()]
        _compare_names(bundle, graph, "input", [t.name for t in signature.inputs], session.get_inputs())
        _compare_names(bundle, graph, "output", [t.name for t in signature.outputs], session.get_outputs())
        outputs = run_graph(session, golden[graph].inputs)
        expected = golden[graph].outputs
        if set(expected) != set(names):
            raise BundleError(
                f"{bundle.folder}: {graph}.onnx has the outputs {', '.join(names)}, "
                f"golden values there are for {', '.join(expected) or 'none'}"
            )
        for name in names:
            relative = _relative_deviation(outputs[name], expected[name])
            if not relative <= bundle.manifest.golden_tolerance:
                raise BundleError(
                    f"{bundle.folder}: self-test failed: {graph}.onnx, output {name} "
                    f"is off by {relative:.2g} (at most {bundle.manifest.golden_tolerance:.2g})"
                )
            deviations.append(Deviation(graph, name, relative))
    return tuple(deviations)


def _relative_deviation(found: NDArray[Any], expected: NDArray[Any]) -> float:
    """Return the largest deviation over the largest expected magnitude; infinite if shape or NaN differ."""
    if found.shape != expected.shape:
        return float("inf")
    if expected.size == 0:
        return 0.0
    first, second = found.astype(np.float64), expected.astype(np.float64)
    if not np.array_equal(np.isfinite(first), np.isfinite(second)):
        return float("inf")
    finite = np.isfinite(second)
    if not finite.any():
        return 0.0
    scale = max(float(np.abs(second[finite]).max()), 1e-9)
    return float(np.abs(first[finite] - second[finite]).max()) / scale


def _compare_names(bundle: Bundle, graph: str, side: str, listed: list[str], actual: Any) -> None:
    names = [item.name for item in actual]
    if names != listed:
        raise BundleError(
            f"{bundle.folder}: {graph}.onnx: the manifest lists the {side}s {', '.join(listed)}, "
            f"the graph has {', '.join(names)}"
        )
