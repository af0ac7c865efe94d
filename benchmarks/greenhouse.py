"""What the mechanistic greenhouse is worth: speed, and errors against Wageningen's simulator.

python -m benchmarks.greenhouse speed
python -m benchmarks.greenhouse wur DATA
python -m benchmarks.greenhouse calibrate DATA
python -m benchmarks.greenhouse agc DATA
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

from benchmarks import greenhouse_agc, greenhouse_wur
from igrow.core.greenhouse import GreenhouseParameters, generate_weather, recipe, simulate_many

START = np.datetime64("2020-03-01T00:00:00", "s")


def speed() -> None:
    weather = generate_weather(START, START + np.timedelta64(8, "D"), seed=1)
    rng = np.random.default_rng(0)
    for count, hours in ((1, 96), (100, 24), (1000, 12), (4000, 6)):
        end = START + np.timedelta64(hours, "h")
        parameters = [GreenhouseParameters().varied(rng) for _ in range(count)]
        begin = time.process_time()
        simulate_many(parameters, weather, recipe, START, end, count=count, seed=1)
        spent = time.process_time() - begin
        days = count * hours / 24.0
        step = 1e3 * spent / (hours * 12)
        pace = f"{days / spent:8.1f} greenhouse-days/s of one core, {step:7.2f} ms per 300 s step"
        print(f"{count:5d} greenhouses at once: {pace}")


def main(arguments: list[str]) -> int:
    if arguments[:1] == ["speed"] and len(arguments) == 1:
        speed()
        return 0
    if len(arguments) == 2 and arguments[0] in ("wur", "calibrate", "agc"):
        data = Path(arguments[1])
        if arguments[0] == "agc":
            print("\n".join(greenhouse_agc.table(data)))
            return 0
        if arguments[0] == "wur":
            print("\n".join(greenhouse_wur.table(data)))
        else:
            for name, value in greenhouse_wur.calibrate(data).items():
                print(f'    "{name}": {value:.4g},')
        return 0
    print(__doc__, file=sys.stderr)
    return 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
