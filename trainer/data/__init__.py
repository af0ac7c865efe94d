"""Data: from the files that a log comes in to one table on a regular grid, and the record that models are fitted to.

    files --> source (names, units, UTC) --> screening (what no model may be fitted to) --> grid --> Log --> Record

`read_log` walks that road for every command, benchmark and notebook; nothing else reads a log.
"""

from igrow.trainer.data.log import Log
from igrow.trainer.data.reading import prepare_log, read_log

__all__ = ["Log", "prepare_log", "read_log"]
