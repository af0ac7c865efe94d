"""What runs the graphs reports to nobody."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path


def test_importing_the_runtime_writes_nothing_into_the_home_folder(tmp_path: Path) -> None:
    environment = {key: value for key, value in os.environ.items() if key != "ORT_DISABLE_TELEMETRY"}
    environment |= {"HOME": str(tmp_path), "XDG_CACHE_HOME": str(tmp_path / "cache"), "PYTHONDONTWRITEBYTECODE": "1"}
    code = "import igrow.core.bundle, onnxruntime, os; print(len(os.listdir('/proc/self/task')))"
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        env=environment,
        cwd=Path(__file__).parents[2],
    )
    assert list(tmp_path.rglob("*")) == []
    assert done.stderr == ""
