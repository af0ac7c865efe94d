"""Graphs in onnxruntime: opened with few threads and quietly, run by the names of inputs and outputs."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from igrow.core.bundle.manifest import BundleError
from igrow.core.errors import first_line


def new_session(graph: Path | bytes) -> Any:
    """Open a graph, a file or a serialised model, in onnxruntime, on one thread; raises what onnxruntime raises.

    A gateway shares its cores with the control cycle, so the number of threads is never left to the library. Nor is its
    memory: the library is loaded by whoever opens a graph, and the daemon opens none.
    """
    onnxruntime = importlib.import_module("onnxruntime")
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    options.inter_op_num_threads = 1
    options.log_severity_level = 4  # its reasons reach the user through the exception
    source = graph if isinstance(graph, bytes) else str(graph)
    return onnxruntime.InferenceSession(source, options, providers=["CPUExecutionProvider"])


def open_session(path: Path) -> Any:
    """Open a graph's file in onnxruntime; raises BundleError where it cannot."""
    try:
        return new_session(path)
    except Exception as error:
        raise BundleError(f"{path}: onnxruntime cannot load the graph: {first_line(error)[:200]}") from None


def run_graph(session: Any, inputs: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Run one graph; returns its outputs by name. Raises BundleError where onnxruntime refuses the inputs."""
    names = [output.name for output in session.get_outputs()]
    try:
        return dict(zip(names, session.run(names, dict(inputs)), strict=True))
    except Exception as error:
        raise BundleError(f"the graph does not run: {first_line(error)[:200]}") from None
