"""One round of the courier, as a process."""

from __future__ import annotations

import sys

from igrow.edge.exchange.courier import main

sys.exit(main(sys.argv[1:]))
