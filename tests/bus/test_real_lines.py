"""The same bus over the real thing: TCP sockets, TLS, and a serial port (a pseudo terminal)."""

from __future__ import annotations

import asyncio
import datetime
import fcntl
import os
import pty
import ssl
import tty
from pathlib import Path
from typing import Any

import pytest

from igrow.edge.bus.errors import NotConnectedError
from igrow.edge.bus.modbus_bus import ModbusBus
from igrow.edge.bus.protocol import Priority, ReadRequest, WriteRequest
from igrow.edge.registers.model import BusSettings, Function, Parity, Transport
from igrow.edge.virtual_plc.modbus_server import ModbusServer, _SerialConnection, _TcpConnection
from tests.bus.coded_unit import CodedUnit, code


async def exchange(settings: BusSettings, unit: CodedUnit) -> None:
    bus = ModbusBus(settings)
    bus.start()
    try:
        content = await bus.read(ReadRequest(1, Function.INPUT, 3, 40), Priority.CONTROL)
        assert content == tuple(code(1, Function.INPUT, a) for a in range(3, 43))
        await bus.write(WriteRequest(1, Function.HOLDING, 300, (1, 2)), Priority.WRITE)
        assert unit.writes == [(Function.HOLDING, 300, (1, 2))]
    finally:
        await bus.close()


@pytest.mark.parametrize("transport", [Transport.TCP, Transport.RTU_OVER_TCP], ids=lambda t: t.value)
async def test_over_a_socket(transport: Transport) -> None:
    unit = CodedUnit(1)
    server = ModbusServer({1: unit})
    port = await server.listen("127.0.0.1", 0, rtu=transport.is_rtu)
    await exchange(BusSettings("line", transport, host="127.0.0.1", port=port), unit)
    await server.close()


class TerminalEnd(asyncio.Transport):
    """The far end of a pseudo terminal, as a transport."""

    def __init__(self, descriptor: int, protocol: asyncio.Protocol) -> None:
        super().__init__()
        self.descriptor = descriptor
        asyncio.get_running_loop().add_reader(descriptor, lambda: protocol.data_received(os.read(descriptor, 1024)))
        protocol.connection_made(self)

    def write(self, data: Any) -> None:
        os.write(self.descriptor, data)

    def close(self) -> None:
        asyncio.get_running_loop().remove_reader(self.descriptor)
        os.close(self.descriptor)


async def test_over_a_serial_port() -> None:
    unit = CodedUnit(1)
    far, near = pty.openpty()
    tty.setraw(near)
    end = TerminalEnd(far, _SerialConnection({1: unit}, set()))
    settings = BusSettings("line", Transport.RTU, serial_port=os.ttyname(near), parity=Parity.NONE, gap=0.005)
    try:
        await exchange(settings, unit)
    finally:
        end.close()
        os.close(near)


async def test_a_serial_port_that_is_not_there_is_named() -> None:
    bus = ModbusBus(BusSettings("line", Transport.RTU, serial_port="/dev/no-such-port"))
    bus.start()
    with pytest.raises(NotConnectedError):
        await bus.read(ReadRequest(1, Function.INPUT, 0, 1), Priority.CONTROL)
    await bus.close()


async def test_a_serial_port_that_another_has_open_is_said_to_be_taken(
    caplog: pytest.LogCaptureFixture,
) -> None:
    far, near = pty.openpty()
    fcntl.flock(near, fcntl.LOCK_EX)
    bus = ModbusBus(BusSettings("line", Transport.RTU, serial_port=os.ttyname(near), parity=Parity.NONE))
    bus.start()
    with pytest.raises(NotConnectedError):
        await bus.read(ReadRequest(1, Function.INPUT, 0, 1), Priority.CONTROL)
    assert f"no connection to {os.ttyname(near)}: another program has it open" in caplog.text
    await bus.close()
    os.close(near)
    os.close(far)


def make_certificate(folder: Path) -> tuple[Path, Path]:
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec

    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "plc")])
    start = datetime.datetime(2020, 1, 1, tzinfo=datetime.UTC)
    certificate = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(1)
        .not_valid_before(start)
        .not_valid_after(start + datetime.timedelta(days=36500))
        .add_extension(x509.SubjectAlternativeName([x509.DNSName("plc")]), critical=False)
        .sign(key, hashes.SHA256())
    )
    certificate_file, key_file = folder / "plc.pem", folder / "plc.key"
    certificate_file.write_bytes(certificate.public_bytes(serialization.Encoding.PEM))
    key_file.write_bytes(
        key.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
    )
    return certificate_file, key_file


async def serve_tls(folder: Path, unit: CodedUnit) -> tuple[asyncio.Server, int, Path]:
    certificate, key = make_certificate(folder)
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    context.load_cert_chain(certificate, key)
    loop = asyncio.get_running_loop()
    server = await loop.create_server(lambda: _TcpConnection({1: unit}, set()), "127.0.0.1", 0, ssl=context)
    return server, server.sockets[0].getsockname()[1], certificate


async def test_over_tls(tmp_path: Path) -> None:
    unit = CodedUnit(1)
    server, port, certificate = await serve_tls(tmp_path, unit)
    settings = BusSettings(
        "line", Transport.TLS, host="127.0.0.1", port=port, certificate_authority=certificate, server_name="plc"
    )
    await exchange(settings, unit)
    server.close()


async def test_a_server_with_another_certificate_is_not_trusted(tmp_path: Path) -> None:
    server, port, _ = await serve_tls(tmp_path, CodedUnit(1))
    other = tmp_path / "other"
    other.mkdir()
    foreign, _ = make_certificate(other)
    settings = BusSettings(
        "line", Transport.TLS, host="127.0.0.1", port=port, certificate_authority=foreign, server_name="plc"
    )
    bus = ModbusBus(settings)
    bus.start()
    with pytest.raises(NotConnectedError):
        await bus.read(ReadRequest(1, Function.INPUT, 0, 1), Priority.CONTROL)
    await bus.close()
    server.close()
