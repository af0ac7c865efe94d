"""pymodbus changes without notice: it stays behind the link and the serial port."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_only_the_link_and_the_serial_port_know_pymodbus() -> None:
    sources = [path for room in ("edge", "igrow_core", "trainer") for path in (ROOT / room).rglob("*.py")]
    knowing = [
        str(path.relative_to(ROOT))
        for path in sources
        if "import pymodbus" in (text := path.read_text()) or "from pymodbus" in text
    ]
    assert sorted(knowing) == ["edge/bus/pymodbus_link.py", "edge/bus/serial_port.py"]
