"""Register maps from YAML: what is right loads, what is wrong is told with its place."""

from __future__ import annotations

from pathlib import Path

import pytest

from igrow.core.errors import IgrowError
from igrow.core.quantities import QUANTITIES, SETPOINTS, USUAL_SETPOINTS, Kind
from igrow.edge.registers.bus_load import BusLoad, estimate
from igrow.edge.registers.loading import load_register_map, parse_register_map
from igrow.edge.registers.model import ByteOrder, DataType, Function, Parity, Transport

GOLDEN = Path(__file__).parent / "golden"
MAPS = Path(__file__).parents[2] / "config" / "register-maps"


@pytest.mark.parametrize("folder", sorted(GOLDEN.iterdir()), ids=lambda folder: folder.name)
def test_a_wrong_map_is_refused_with_line_column_and_advice(folder: Path) -> None:
    with pytest.raises(IgrowError) as caught:
        load_register_map(folder / "map.yaml")
    assert (
        str(caught.value).replace(str(folder / "map.yaml"), "map.yaml") == (folder / "expected.txt").read_text().strip()
    )


@pytest.mark.parametrize("path", sorted(MAPS.glob("*.yaml")), ids=lambda path: path.stem)
def test_every_map_that_we_ship_loads_names_its_source_and_claims_no_hardware_test(path: Path) -> None:
    register_map = load_register_map(path)
    assert register_map.source
    assert not register_map.hardware_tested
    assert all(load.acceptable for load in estimate(register_map))


def test_every_template_for_real_equipment_says_what_to_check_on_site() -> None:
    templates = [path for path in sorted(MAPS.glob("*.yaml")) if path.stem != "virtual-plc"]
    assert len(templates) >= 4
    for path in templates:
        assert "Untested on hardware." in path.read_text()
        assert load_register_map(path).check_on_site


def test_the_virtual_plc_serves_every_quantity_and_every_setpoint_can_be_written() -> None:
    points = load_register_map(MAPS / "virtual-plc.yaml").points
    needed = {name for name, quantity in QUANTITIES.items() if quantity.kind is not Kind.MARK}
    assert needed - {*SETPOINTS} | {*USUAL_SETPOINTS} <= set(points)
    writable = {name: point.refresh for name, point in points.items() if point.writable}
    assert writable == {**dict.fromkeys((*USUAL_SETPOINTS, "heartbeat")), "vent_lee": 900.0, "vent_wind": 900.0}


FULL = """
title: everything that a map can say
source: none
buses:
  network: {transport: tls, host: 192.0.2.1, certificate_authority: ca.pem, server_name: plc}
  line: {transport: rtu, serial_port: ttyS0, baudrate: 38400, parity: none, stop_bits: 2, timeout: 0.5 s, gap: 0.1 s}
devices:
  plc: {bus: network, device_id: 3, gap: 0.02 s, longest_block: 60, bridge: 2}
  sensor: {bus: line, device_id: 240, unreadable: [{function: input, first: 8, last: 9}]}
points:
  air_co2: {device: sensor, function: input, address: 0, type: float32, order: CDAB, unit: ppm, poll: 10 s}
  heating_setpoint:
    device: plc
    function: holding
    address: 0x10
    type: int16
    scale: 0.1
    offset: -5
    unit: degC
    low: 8
    high: 30
    writable: true
    refresh: 2 min
"""


def test_everything_that_a_map_can_say_is_understood() -> None:
    register_map = parse_register_map(FULL)
    network, line = register_map.buses["network"], register_map.buses["line"]
    assert (network.transport, network.port, network.server_name) == (Transport.TLS, 802, "plc")
    assert (line.baudrate, line.parity, line.stop_bits, line.timeout, line.gap) == (38400, Parity.NONE, 2, 0.5, 0.1)
    assert register_map.devices["sensor"].unreadable == ((Function.INPUT, 8, 9),)
    point = register_map.points["heating_setpoint"]
    assert (point.address, point.scale, point.offset, point.low, point.high) == (16, 0.1, -5.0, 8.0, 30.0)
    assert (point.type, point.order, point.refresh) == (DataType.INT16, ByteOrder.ABCD, 120.0)
    assert register_map.points["air_co2"].order is ByteOrder.CDAB
    assert (register_map.points["air_co2"].low, register_map.points["air_co2"].high) == (150.0, 5000.0)


def test_a_serial_bus_rests_30_ms_between_requests_unless_told_otherwise() -> None:
    text = FULL.replace(", gap: 0.1 s", "")
    assert parse_register_map(text).buses["line"].gap == 0.03


def test_the_load_of_a_serial_line_is_its_time_on_the_wire() -> None:
    """20 registers at 19,200 baud, even parity: (8 + 45 + 7) characters of 11 bits, 5 ms to think, 30 ms of gap."""
    text = """
title: one sensor
source: none
buses:
  line: {transport: rtu, serial_port: /dev/ttyUSB0, baudrate: 19200}
devices:
  sensor: {bus: line, device_id: 1, bridge: 20}
points:
  air_temperature: {device: sensor, function: input, address: 0, type: float32, unit: degC, poll: 1 s}
  air_humidity: {device: sensor, function: input, address: 18, type: float32, unit: "%", poll: 1 s}
"""
    (load,) = estimate(parse_register_map(text))
    assert load.busy == pytest.approx(60 * 11 / 19200 + 0.005 + 0.03)
    assert load.requests_per_second == 1.0


def test_the_limit_of_the_load_is_half_of_the_time() -> None:
    assert BusLoad("line", 1.0, 0.5).acceptable
    assert not BusLoad("line", 1.0, 0.51).acceptable


def test_a_second_sensor_has_the_quantitys_name_with_a_2_and_its_unit() -> None:
    text = FULL.replace("  air_co2:", "  air_co2_2:").replace(
        "address: 0, type: float32, order", "address: 4, type: float32, order"
    )
    assert parse_register_map(text).points["air_co2_2"].high == 5000.0
    with pytest.raises(IgrowError, match="not known"):
        parse_register_map(FULL.replace("  heating_setpoint:", "  heating_setpoint_2:"))
