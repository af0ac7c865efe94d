"""Lets `python -m edge.cli` do what `igrow-edge` does."""

import sys

from edge.cli import main

sys.exit(main())
