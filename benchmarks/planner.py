"""How fast the genetic algorithm is without a simulator: generations a second, in numpy and as optimizer.onnx."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import numpy as np

from igrow.core.planner import EvolutionSettings, NumpyGeneration
from igrow.core.planner.evolution import draw
from igrow.core.planner.onnx_generation import OnnxGeneration
from igrow.trainer.exporting.optimizer import export_optimizer


def main() -> None:
    rng = np.random.default_rng(0)
    settings = EvolutionSettings()
    genes = 48
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "optimizer.onnx"
        model = export_optimizer(settings)
        path.write_bytes(model.SerializeToString())
        print(f"optimizer.onnx: {len(model.graph.node)} nodes, {path.stat().st_size} bytes")
        for name, run in (("numpy", NumpyGeneration(settings)), ("optimizer.onnx", OnnxGeneration(path))):
            parents = rng.random((settings.parents, genes), dtype=np.float32)
            offspring = rng.random((settings.offspring, genes), dtype=np.float32)
            fitness = rng.standard_normal(settings.parents).astype(np.float32)
            values = rng.standard_normal(settings.offspring).astype(np.float32)
            random = draw(rng, settings, genes)
            began = time.perf_counter()
            for _turn in range(1000):
                parents, fitness, offspring = run(parents, fitness, offspring, values, random)
            rate = 1000 / (time.perf_counter() - began)
            print(f"{name:16s}{rate:9.0f} generations/s of {settings.offspring} candidates of {genes} genes")


if __name__ == "__main__":
    main()
