"""The gateway's memory: telemetry in packed rows, and a ledger of events, writes and alarms.

Two kinds of record with two promises. Telemetry (`telemetry.db`) is much and cheap: rows are collected and
committed together, at most the last batch is lost by `kill -9` or a power cut, the oldest days make room for
new ones. The ledger (`ledger-a.db` and its twin `ledger-b.db`) is little and dear: each record is on the disk,
twice, before the call returns.

Whatever happens to the disk, the daemon goes on: a corrupt file is set aside, what can be read is carried
over, and the fact is recorded; with a full or read-only disk records wait in memory and `health` says so.
"""

from igrow.edge.store.aside import StoreAside
from igrow.edge.store.maintenance import backup, export, restore
from igrow.edge.store.store import SqliteStore, StoreError, StoreLimits, read_event, read_records, read_telemetry

__all__ = [
    "SqliteStore",
    "StoreAside",
    "StoreError",
    "StoreLimits",
    "backup",
    "export",
    "read_event",
    "read_records",
    "read_telemetry",
    "restore",
]
