"""Networks of the published size: strategy-hours per second, by runtime, against this machine's matrix product.

python -m benchmarks.network

Climate 13 -> 300 x 4 -> 3, growth 7 -> 300 x 4 -> 3, yield 4 -> 600 x 4 -> 1 once a day, ReLU, float32: Cao et al.
(2022). Weights are random; the arithmetic is the same. The limit is the rate at which this machine multiplies
matrices of these shapes and nothing else, on the same cores in the same run. Seconds are those that the processor spent
on it, so that other work on the machine lowers neither; on an idle machine they are the clock's.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import onnx
import torch
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from igrow.core.bundle import new_session

Weights = list[tuple[NDArray[np.float32], NDArray[np.float32]]]

HOURS = 24
DRIVERS, CLIMATE, GROWTH = 10, 3, 3
"""Weather and setpoints; climate; growth. Growth reads the climate, and par from the drivers."""
SIZES = {
    "climate": (13, 300, 300, 300, 300, 3),
    "growth": (7, 300, 300, 300, 300, 3),
    "yield": (4, 600, 600, 600, 600, 1),
}
SECONDS = 2.0


@dataclass(frozen=True)
class Setting:
    """What is run."""

    candidates: int
    seed: int = 0


def weights(seed: int) -> dict[str, Weights]:
    generator = np.random.default_rng(seed)
    return {
        name: [
            ((generator.standard_normal((a, b)) / np.sqrt(a)).astype(np.float32), np.zeros(b, dtype=np.float32))
            for a, b in pairwise(sizes)
        ]
        for name, sizes in SIZES.items()
    }


def inputs(setting: Setting) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Drivers (24, candidates, 10) and the state (candidates, 7): climate, growth, harvest."""
    generator = np.random.default_rng(setting.seed)
    drivers = generator.standard_normal((HOURS, setting.candidates, DRIVERS)).astype(np.float32)
    return drivers, generator.standard_normal((setting.candidates, CLIMATE + GROWTH + 1)).astype(np.float32)


def flops_per_hour() -> float:
    """Multiplications and additions of one strategy-hour."""
    product = {name: 2.0 * sum(a * b for a, b in pairwise(s)) for name, s in SIZES.items()}
    return product["climate"] + product["growth"] + product["yield"] / HOURS


def rate(step: Callable[[], object], strategy_hours: float) -> float:
    """Strategy-hours per processor second: the best of as many runs as fit into two seconds, at least two."""
    step()
    best, began, runs = np.inf, time.process_time(), 0
    while runs < 2 or time.process_time() - began < SECONDS:
        start = time.process_time()
        step()
        best = min(best, time.process_time() - start)
        runs += 1
    return strategy_hours / best


def numpy_rate(setting: Setting) -> float:
    nets, (drivers, start) = weights(setting.seed), inputs(setting)

    def net(layers: Weights, values: NDArray[np.float32]) -> NDArray[np.float32]:
        for matrix, bias in layers[:-1]:
            values = np.maximum(values @ matrix + bias, 0.0)
        return values @ layers[-1][0] + layers[-1][1]

    def day() -> NDArray[np.float32]:
        climate, growth = start[:, :CLIMATE], start[:, CLIMATE : CLIMATE + GROWTH]
        for hour in range(HOURS):
            climate = climate + net(nets["climate"], np.concatenate([drivers[hour], climate], axis=1))
            growth = growth + net(nets["growth"], np.concatenate([climate, drivers[hour, :, :1], growth], axis=1))
        return start[:, -1:] + net(nets["yield"], np.concatenate([growth, start[:, -1:]], axis=1))

    return rate(day, setting.candidates * HOURS)


def torch_rate(setting: Setting) -> float:
    torch.set_num_threads(1)
    nets = {n: [(torch.tensor(m), torch.tensor(b)) for m, b in layers] for n, layers in weights(setting.seed).items()}
    drivers, start = (torch.tensor(values) for values in inputs(setting))

    def net(layers: Sequence[tuple[torch.Tensor, torch.Tensor]], values: torch.Tensor) -> torch.Tensor:
        for matrix, bias in layers[:-1]:
            values = torch.relu(torch.addmm(bias, values, matrix))
        return torch.addmm(layers[-1][1], values, layers[-1][0])

    def day() -> torch.Tensor:
        climate, growth = start[:, :CLIMATE], start[:, CLIMATE : CLIMATE + GROWTH]
        for hour in range(HOURS):
            climate = climate + net(nets["climate"], torch.cat([drivers[hour], climate], dim=1))
            growth = growth + net(nets["growth"], torch.cat([climate, drivers[hour, :, :1], growth], dim=1))
        return start[:, -1:] + net(nets["yield"], torch.cat([growth, start[:, -1:]], dim=1))

    with torch.inference_mode():
        return rate(day, setting.candidates * HOURS)


def graph(seed: int, hours: int, with_yield: bool) -> Any:
    """The networks over `hours` in one graph: drivers (hours, n, 10), state (n, 7) -> state."""
    nodes: list[onnx.NodeProto] = []
    constants = [numpy_helper.from_array(np.array(hour), f"hour{hour}") for hour in range(hours)]
    constants += [
        numpy_helper.from_array(values, f"{name}.{part}{index}")
        for name, layers in weights(seed).items()
        if name != "yield" or with_yield
        for index, layer in enumerate(layers)
        for part, values in zip(("matrix", "bias"), layer, strict=True)
    ]
    constants.append(numpy_helper.from_array(np.array([CLIMATE, GROWTH, 1]), "split"))
    constants.append(numpy_helper.from_array(np.array([1, DRIVERS - 1]), "light"))

    def add(operation: str, given: Sequence[str], out: str, **attributes: Any) -> str:
        nodes.append(helper.make_node(operation, list(given), [out], **attributes))
        return out

    def net(name: str, values: str, out: str) -> str:
        last = len(SIZES[name]) - 2
        for index in range(last + 1):
            layer = (f"{name}.matrix{index}", f"{name}.bias{index}")
            values = add("Gemm", [values, *layer], f"{out}.{index}")
            if index < last:
                values = add("Relu", [values], f"{out}.{index}.relu")
        return values

    nodes.append(helper.make_node("Split", ["state", "split"], ["climate", "growth", "harvest"], axis=1))
    climate, growth, harvest = "climate", "growth", "harvest"
    for hour in range(hours):
        now = add("Gather", ["drivers", f"hour{hour}"], f"now{hour}", axis=0)
        nodes.append(helper.make_node("Split", [now, "light"], [f"light{hour}", f"rest{hour}"], axis=1))
        joined = add("Concat", [now, climate], f"c{hour}", axis=1)
        climate = add("Add", [climate, net("climate", joined, f"cn{hour}")], f"climate{hour}")
        joined = add("Concat", [climate, f"light{hour}", growth], f"g{hour}", axis=1)
        growth = add("Add", [growth, net("growth", joined, f"gn{hour}")], f"growth{hour}")
    if with_yield:
        joined = add("Concat", [growth, harvest], "y", axis=1)
        harvest = add("Add", [harvest, net("yield", joined, "yn")], "harvested")
    add("Concat", [climate, growth, harvest], "next", axis=1)
    value = helper.make_tensor_value_info
    model = helper.make_model(
        helper.make_graph(
            nodes, "networks",
            [value("drivers", TensorProto.FLOAT, [hours, "n", DRIVERS]), value("state", TensorProto.FLOAT, ["n", 7])],
            [value("next", TensorProto.FLOAT, ["n", 7])], constants,
        ),
        opset_imports=[helper.make_opsetid("", 18)], ir_version=9,
    )  # fmt: skip
    return new_session(model.SerializeToString())


def hourly_session_rate(setting: Setting) -> float:
    session, last = graph(setting.seed, 1, False), graph(setting.seed, 1, True)
    drivers, start = inputs(setting)

    def day() -> object:
        state = start
        for hour in range(HOURS):
            run = last if hour == HOURS - 1 else session
            state = run.run(None, {"drivers": drivers[hour : hour + 1], "state": state})[0]
        return state

    return rate(day, setting.candidates * HOURS)


def day_session_rate(setting: Setting) -> float:
    session = graph(setting.seed, HOURS, True)
    drivers, start = inputs(setting)
    return rate(lambda: session.run(None, {"drivers": drivers, "state": start}), setting.candidates * HOURS)


def product_rate(setting: Setting) -> float:
    """Floating point operations per second of a bare matrix product, candidates x 300 x 300, the better of two."""
    torch.set_num_threads(1)
    one = np.random.default_rng(setting.seed).standard_normal((setting.candidates, 300)).astype(np.float32)
    two = np.random.default_rng(1).standard_normal((300, 300)).astype(np.float32)
    operations = 2.0 * setting.candidates * 300 * 300
    out, first, second = np.empty_like(one), torch.tensor(one), torch.tensor(two)
    repeats = max(1, 20_000 // setting.candidates)

    def plain() -> None:
        for _ in range(repeats):
            np.matmul(one, two, out=out)

    result = torch.empty_like(first)

    def torched() -> None:
        for _ in range(repeats):
            torch.mm(first, second, out=result)

    return max(rate(plain, operations * repeats), rate(torched, operations * repeats))


def on_two_cores(measure: Callable[[Setting], float], candidates: int) -> float:
    """The sum of two processes that do half each, at the same time."""
    with ProcessPoolExecutor(2) as pool:
        return sum(pool.map(measure, [Setting(candidates // 2, 1), Setting(candidates // 2, 2)]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--candidates", type=int, default=1000)
    count = parser.parse_args().candidates
    one = Setting(count)
    limit, work = product_rate(one), flops_per_hour()
    print(f"networks of the published size, {work / 1e6:.2f} MFLOP per strategy-hour, {count} candidates")
    print(f"| runtime | strategy-hours/s | of the matrix product ({limit / 1e9:.0f} GFLOP/s on one core) |")
    print("|---|---|---|")
    for name, measure in (
        ("numpy", numpy_rate),
        ("torch", torch_rate),
        ("onnxruntime, a session call per hour", hourly_session_rate),
        ("onnxruntime, a day in one graph", day_session_rate),
    ):
        found = measure(one)
        print(f"| {name} | {found:,.0f} | {found * work / limit:.2f} |", flush=True)
    both, limit_of_both = on_two_cores(day_session_rate, count), on_two_cores(product_rate, count)
    print(f"| two processes, a day in one graph | {both:,.0f} | {both * work / limit_of_both:.2f} of both cores |")


if __name__ == "__main__":
    main()
