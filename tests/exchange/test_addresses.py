"""An address of an exchange is understood, or refused in one sentence that says what is right."""

from __future__ import annotations

from pathlib import Path

import pytest

from igrow.core.errors import IgrowError
from igrow.core.exchange.address import parse_address
from igrow.edge.configuration import ConfigurationError, load_configuration

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("/srv/igrow", "/srv/igrow"),
        ("shared", "/base/shared"),
        ("file:///srv/ig%20row", "/srv/ig row"),
        ("sftp://igrow@host/srv/igrow", "sftp://igrow@host/srv/igrow"),
        ("sftp://igrow@host:2222/srv", "sftp://igrow@host:2222/srv"),
        ("s3://bucket/a/b/", "s3://bucket/a/b"),
        ("s3://bucket?endpoint=https://s3.local:9000", "s3://bucket/?endpoint=https://s3.local:9000"),
    ],
)
def test_an_address_is_understood(text: str, shown: str) -> None:
    assert str(parse_address(text, Path("/base"))) == shown


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("sftp://igrow:secret@host/x", "a password has no place"),
        ("ftp://host/x", "no address of an exchange"),
        ("sftp:///x", "no address of an exchange"),
        ("sftp://host:99999/x", "its port"),
        ("sftp://-oProxyCommand=touch@host/x", "begins with a dash"),
        ("file://host/x", "no address of an exchange"),
    ],
)
def test_what_is_no_address_is_refused(text: str, reason: str) -> None:
    with pytest.raises(IgrowError, match=reason) as error:
        parse_address(text)
    assert "secret" not in str(error.value)


def test_sftp_without_a_pinned_key_is_refused_when_the_configuration_is_read(tmp_path: Path) -> None:
    path = tmp_path / "daemon.yaml"
    text = f"site: {ROOT}/config/site.yaml\nregister_map: {ROOT}/config/register-maps/virtual-plc.yaml\n"
    path.write_text(text + "exchange: sftp://igrow@host/x\n")
    with pytest.raises(ConfigurationError, match=r"daemon\.yaml:3:\d+: the server's key must be pinned"):
        load_configuration(path)
    path.write_text(text + "exchange: sftp://igrow@host/x\ntransfer: {known_hosts: pinned}\n")
    assert load_configuration(path).known_hosts == tmp_path / "pinned"
