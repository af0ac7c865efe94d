"""Lets `python -m igrow.edge.cli` do what `igrow-edge` does."""

import sys

from igrow.edge.cli import main

sys.exit(main())
