"""A segment: one zip file with the seal, the telemetry as CSV and the records as JSON lines.

Any program that opens zip files shows what is in it. Equal content gives an equal file.
"""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from igrow.core.errors import IgrowError
from igrow.core.exchange.documents import parse_lines, parse_object
from igrow.core.exchange.errors import DamagedError, SegmentError
from igrow.core.exchange.seal import Seal, SegmentName, read_seal
from igrow.core.exchange.units import conversion
from igrow.core.telemetry import Telemetry, format_csv, parse_cells, parse_numbers, parse_times

SEAL, TELEMETRY, EVENTS = "seal.json", "telemetry.csv", "events.jsonl"
LARGEST_SEGMENT = 64 * 2**20
"""Bytes of the file; a day of 60 points every 5 s has less than 2 MB."""
LARGEST_CONTENT = 512 * 2**20
"""Bytes once unpacked."""
LARGEST_VALUE = 1e30
"""Far above any quantity in any unit, and within what four bytes hold."""
_ZIP_EPOCH = (1980, 1, 1, 0, 0, 0)


@dataclass(frozen=True)
class Segment:
    """An opened segment."""

    name: SegmentName
    seal: Seal
    telemetry: Telemetry
    """In the registry's units."""
    foreign: Telemetry
    """Columns that the registry lacks, or whose unit leads nowhere: named `name [unit]`, values as written."""
    events: tuple[Mapping[str, Any], ...]


def pack_segment(seal: Seal, telemetry: Telemetry, events: Sequence[Mapping[str, object]]) -> tuple[SegmentName, bytes]:
    """Return name and content of the file; `seal` needs no digests and counts, they are filled in here."""
    table = format_csv(telemetry).encode()
    lines = "".join(json.dumps(event, default=str) + "\n" for event in events).encode()
    seal = replace(
        seal,
        rows=len(telemetry),
        telemetry_digest=_digest(table),
        records=len(events),
        events_digest=_digest(lines),
    )
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name, content in ((SEAL, (json.dumps(seal.to_json(), indent=1) + "\n").encode()), (TELEMETRY, table),
                              (EVENTS, lines)):  # fmt: skip
            member = zipfile.ZipInfo(name, _ZIP_EPOCH)
            member.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(member, content)
    data = stream.getvalue()
    return SegmentName(seal.chain, seal.number, _digest(data)), data


def open_segment(name: SegmentName, data: bytes, site: str) -> Segment:
    """Return what a segment's file holds.

    Raises DamagedError where it is not the file that its name says, and SegmentError where it is and cannot be used.
    """
    if not name.is_of(data):
        raise DamagedError(f"{name}: cut short or altered on its way")
    try:
        return _open(name, data, site)
    except DamagedError:
        raise
    except (IgrowError, zipfile.BadZipFile, zlib.error, KeyError, EOFError, NotImplementedError, RuntimeError) as error:
        raise SegmentError(f"{name.chain}-{name.number:08d}: {error}") from None


def peek_seal(data: bytes) -> Seal:
    """Return the seal of a file of our own making; raises SegmentError."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            return read_seal(parse_object(archive.read(SEAL), SEAL))
    except (IgrowError, zipfile.BadZipFile, zlib.error, KeyError, EOFError) as error:
        raise SegmentError(f"its seal cannot be read: {error}") from None


def _open(name: SegmentName, data: bytes, site: str) -> Segment:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {member.filename: member for member in archive.infolist()}
        if sorted(members) != sorted((SEAL, TELEMETRY, EVENTS)):
            raise SegmentError(f"holds {', '.join(sorted(members)[:5])} instead of {SEAL}, {TELEMETRY} and {EVENTS}")
        if sum(member.file_size for member in members.values()) > LARGEST_CONTENT:
            raise SegmentError(f"more than {LARGEST_CONTENT >> 20} MiB once unpacked")
        seal = read_seal(parse_object(archive.read(SEAL), SEAL))
        table, lines = archive.read(TELEMETRY), archive.read(EVENTS)
    if seal.site != site:
        raise SegmentError(f"sealed by site {seal.site}, found among those of {site}")
    if (seal.chain, seal.number) != (name.chain, name.number):
        raise SegmentError(f"its seal says {seal.chain}-{seal.number:08d}")
    if _digest(table) != seal.telemetry_digest or _digest(lines) != seal.events_digest:
        raise SegmentError("its content is not what its seal says")
    known, foreign = _columns(table, seal)
    events = tuple(parse_lines(lines, EVENTS))
    if (len(known), len(events)) != (seal.rows, seal.records):
        raise SegmentError(
            f"has {len(known)} rows and {len(events)} records, its seal says {seal.rows} and {seal.records}"
        )
    return Segment(name, seal, known, foreign, events)


def _columns(table: bytes, seal: Seal) -> tuple[Telemetry, Telemetry]:
    """Return the telemetry in the registry's units, and the columns that cannot be brought to them."""
    header, cells, numbers = parse_cells(table, TELEMETRY)
    if not header or header[0] != "time":
        raise SegmentError(f"{TELEMETRY}:1: the first column must be time")
    time = parse_times(TELEMETRY, cells[0], numbers)
    inside = (time >= _instant(seal.start)) & (time < _instant(seal.end + 1.0))
    if not inside.all():
        raise SegmentError(
            f"{TELEMETRY}: rows outside {_instant(seal.start)} to {_instant(seal.end)}, as its seal says"
        )
    if len(time) > 1 and not (np.diff(time) > np.timedelta64(0, "s")).all():
        raise SegmentError(f"{TELEMETRY}: its times do not strictly increase")
    known, foreign = {}, {}
    for name, column in zip(header[1:], cells[1:], strict=True):
        unit = seal.columns.get(name)
        if unit is None:
            raise SegmentError(f"{TELEMETRY}:1: its seal gives no unit of {name}")
        values = parse_numbers(TELEMETRY, name, column, numbers)
        if (np.abs(values) > LARGEST_VALUE).any():
            raise SegmentError(f"{TELEMETRY}: {name} has a value above {LARGEST_VALUE:.0e}, which no sensor shows")
        factors = conversion(name, unit)
        if factors is None:
            foreign[f"{name} [{unit}]"] = values
        else:
            known[name] = values * factors[0] + factors[1] if factors != (1.0, 0.0) else values
    return Telemetry(time, known), Telemetry(time, foreign)


def _instant(seconds: float) -> np.datetime64:
    return np.datetime64(int(seconds // 1), "s")


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()
