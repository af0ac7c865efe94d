"""What is said where somebody names a site that nobody knows."""

from __future__ import annotations

import difflib
from collections.abc import Collection

MOST_NAMES = 10


def known_sites(wanted: str, known: Collection[str]) -> str:
    """Return the names that are known, the ones most like the wanted one first, and how many there are beside them."""
    if not known:
        return "none is known"
    names = difflib.get_close_matches(wanted, known, n=MOST_NAMES, cutoff=0.0)
    more = f" and {len(known) - len(names)} more" if len(known) > len(names) else ""
    return f"known: {', '.join(names)}{more}"
