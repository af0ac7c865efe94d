"""What the files of a site may give as a host."""

from __future__ import annotations

import ipaddress
import re

from igrow.core.yaml_schema import SettingError

_NAME = re.compile(r"[^\s:/@\[\]]+")


def is_address(host: str) -> bool:
    """Tell whether a host is an address, IPv6 with its zone where it needs one, and no name to be looked up."""
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return False
    return True


def check_host(host: str) -> None:
    """Raise SettingError where no machine can be called so, such as for an address with its port."""
    try:
        right = is_address(host) or bool(_NAME.fullmatch(host) and host.encode("idna"))
    except UnicodeError:
        right = False
    if not right:
        raise SettingError(
            f"{host!r} is neither an address nor a name: 192.168.1.50, fd00::50, fe80::50%eth0 or plc.local is right, "
            "and a port has a key of its own",
            "host",
        )
