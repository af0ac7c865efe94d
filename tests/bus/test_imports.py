"""pymodbus changes without notice: it stays behind one file."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_one_file_knows_pymodbus() -> None:
    sources = [path for room in ("edge", "igrow_core", "trainer") for path in (ROOT / room).rglob("*.py")]
    knowing = [
        str(path.relative_to(ROOT))
        for path in sources
        if "import pymodbus" in (text := path.read_text()) or "from pymodbus" in text
    ]
    assert knowing == ["edge/bus/pymodbus_link.py"]
