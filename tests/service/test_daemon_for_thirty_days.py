"""Thirty days of plant time in one run: memory and file handles do not grow."""

from __future__ import annotations

import json
import urllib.request
from pathlib import Path

import numpy as np
import pytest

from igrow.edge.store import read_telemetry
from tests.service.running_daemon import RunningDaemon, open_files, resident_bytes

DAY = 86_400.0


def plant_seconds(plant: RunningDaemon) -> float:
    """Return the plant time that the log covers."""
    try:
        telemetry = read_telemetry(plant.state / "store", 0.0, 8e9)
    except Exception:
        return 0.0
    return float((telemetry.time[-1] - telemetry.time[0]).astype(float)) if len(telemetry) else 0.0


@pytest.mark.soak
def test_thirty_days_grow_neither_memory_nor_file_handles(tmp_path: Path) -> None:
    plant = RunningDaemon(tmp_path)
    try:
        plant.start()
        assert plant.daemon is not None
        pid = plant.daemon.pid
        memory, files = [], []
        for day in range(5, 31):
            plant.wait_for(lambda day=day: plant_seconds(plant) >= day * DAY)
            memory.append(resident_bytes(pid))
            files.append(open_files(pid))
            port = json.loads((plant.state / "status.json").read_text())["port"]
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=10) as answer:
                assert answer.status == 200
        print("memory by day, MB:", " ".join(f"{value / 1e6:.1f}" for value in memory))
        # The first days fill caches and the page's day of history; what grows for ever still grows in the last.
        later = memory[len(memory) // 2 :]
        slope = float(np.polyfit(np.arange(len(later)), later, 1)[0])
        print(
            f"30 days: memory {memory[0] / 1e6:.1f} -> {memory[-1] / 1e6:.1f} MB, in the last {len(later)} days "
            f"{slope / 1e3:.1f} kB a day; file handles {files[0]} -> {files[-1]}"
        )
        assert slope < 10e3, "more than 4 MB a year"
        assert memory[-1] - memory[0] < 2e6
        assert max(files) - min(files) <= 2
        assert plant.stop() == 0
    finally:
        plant.close()
