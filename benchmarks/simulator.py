"""The default bundle's simulator: strategy-hours per second, on one core and on two, against its formulas in numpy.

python -m benchmarks.simulator
"""

from __future__ import annotations

import time
from concurrent.futures import ProcessPoolExecutor

import numpy as np

from igrow.core.arrays import Floats
from igrow.core.bundle import default_bundle_folder, read_bundle
from igrow.core.quantities import SETPOINTS
from igrow.core.simulator.hybrid import climate
from igrow.core.simulator.hybrid.parameters import PARAMETERS
from igrow.core.simulator.plan import STEPS_PER_HOUR, BundleSimulator
from igrow.core.site import Greenhouse

CANDIDATES, HOURS, ROUNDS = 1000, 48, 20
START = np.datetime64("2020-03-01T00:00:00")


def weather() -> Floats:
    """Two plausible days in the planner's six columns."""
    hour = np.arange(HOURS)
    sun = np.maximum(np.sin((hour % 24 - 6) / 12 * np.pi), 0.0)
    columns = [6.0 + 5.0 * sun, 88.0 - 20.0 * sun, np.full(HOURS, 415.0), 420.0 * sun, 3.0 + sun, -4.0 + 4.0 * sun]
    return np.stack(columns, axis=1)


def candidates(seed: int) -> Floats:
    """Random strategies, (candidates, hours, setpoints)."""
    random = np.random.default_rng(seed)
    low, high = np.array([14.0, 400.0, 0.0, 0.0, 70.0]), np.array([24.0, 1000.0, 1.0, 1.0, 90.0])
    return np.asarray(low + (high - low) * random.random((CANDIDATES, HOURS, len(SETPOINTS))))


def graph_rate(seed: int) -> float:
    """Strategy-hours per second of simulator.onnx on one thread, the best of a few rounds."""
    simulator = BundleSimulator(read_bundle(default_bundle_folder()), Greenhouse(), members=1)
    setpoints, course = candidates(seed), weather()
    simulator.simulate({}, course, setpoints, START)
    best = np.inf
    for _ in range(ROUNDS):
        began = time.perf_counter()
        simulator.simulate({}, course, setpoints, START)
        best = min(best, time.perf_counter() - began)
    return CANDIDATES * HOURS / best


def numpy_rate() -> float:
    """The climate stage alone in numpy, at the same steps; the graph does actuation, growth and yield beside it."""
    values = {name: parameter.value for name, parameter in PARAMETERS.items()}
    course = weather()
    spread = np.ones(CANDIDATES)
    shown = {"air_temperature": 20.0 * spread, "air_humidity": 75.0 * spread, "air_co2": 600.0 * spread}
    inputs = dict.fromkeys(climate.INPUTS, 0.0 * spread) | {"mean_height": 5.0, "leaf_area_index": 3.0 * spread}
    for column, name in enumerate(climate.INPUTS[:6]):
        inputs[name] = course[12, column] * spread
    state = climate.initial_state(np, shown, inputs, values, {}, 1.24)
    began = time.perf_counter()
    for _ in range(HOURS * STEPS_PER_HOUR):
        state = climate.advance(np, state, inputs, values, {}, seconds=3600.0 / STEPS_PER_HOUR, lamp_efficacy=1.24)
    return CANDIDATES * HOURS / (time.perf_counter() - began)


def main() -> None:
    """Print the rates and their ratios."""
    one, plain = graph_rate(0), numpy_rate()
    with ProcessPoolExecutor(2) as pool:
        two = sum(pool.map(graph_rate, [1, 2]))
    print(f"simulator.onnx of the default bundle, {CANDIDATES} candidates, {HOURS} h (strategy-hours per second)")
    print(f"  one core     {one:12,.0f}")
    print(f"  two cores    {two:12,.0f}   (goal: 1,000,000)   {two / one:.2f} of one core")
    print(f"  the climate stage alone in numpy, one core {plain:12,.0f}   the graph is {one / plain:.2f} times as fast")


if __name__ == "__main__":
    main()
