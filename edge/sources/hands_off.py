"""The last source: the site's safe setpoints, which are the PLC's own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from igrow.edge.image import Image
from igrow.edge.sources.decision import Offer


@dataclass(frozen=True)
class HandsOff:
    """Offers the safe setpoints, always."""

    safe: Mapping[str, float]
    name: str = "hands_off"

    def offer(self, image: Image) -> Offer:
        """Return the safe setpoints."""
        return Offer("nobody else decides, so the safe setpoints rule", self.safe)
