"""The trainer's receipt: which segments of one chain it holds safely."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from igrow.core.errors import IgrowError
from igrow.core.exchange.documents import parse_object


@dataclass(frozen=True)
class Receipt:
    """All segments up to `through`, and the later ones in `beyond`, are with the trainer or known to be lost.

    Digests say which segments these were: a gateway that was restored from a backup may seal others under the same
    numbers, and must not take the receipt for theirs.
    """

    chain: str
    through: int = 0
    anchor: tuple[int, str] = (0, "")
    """The last number up to `through` that was collected, and its digest; as each segment names the one before by its
    digest, it stands for all of them."""
    beyond: Mapping[int, str] = field(default_factory=dict)
    """Segments above `through` + 1 that came before their turn: number -> digest."""

    def holds(self, number: int) -> bool:
        """Tell whether the trainer waits for this number no more."""
        return number <= self.through or number in self.beyond

    def with_segments(self, segments: Mapping[int, str]) -> Receipt:
        """Return the receipt that covers these segments too: number -> digest, an empty one for what is lost."""
        beyond = {number: digest for number, digest in segments.items() if number > self.through} | dict(self.beyond)
        through, anchor = self.through, self.anchor
        while through + 1 in beyond:
            through += 1
            digest = beyond.pop(through)
            anchor = (through, digest) if digest else anchor
        return Receipt(self.chain, through, anchor, beyond)

    def gaps(self) -> list[tuple[int, int]]:
        """Return the numbers (first, last) that did not come while later ones did."""
        found, expected = [], self.through + 1
        for number in sorted(self.beyond):
            if number > expected:
                found.append((expected, number - 1))
            expected = number + 1
        return found

    def to_json(self) -> dict[str, Any]:
        """Return the document."""
        beyond = {str(number): digest for number, digest in sorted(self.beyond.items())}
        return {"chain": self.chain, "through": self.through, "anchor": list(self.anchor), "beyond": beyond}


def receipt_of(document: Mapping[str, Any], chain: str) -> Receipt:
    """Return the receipt in a document; raises IgrowError where it is none of this chain."""
    try:
        (number, digest), through, beyond = document["anchor"], document["through"], document["beyond"]
        if document["chain"] != chain or not all(type(one) is int and one >= 0 for one in (number, through)):
            raise ValueError(chain)
        return Receipt(chain, through, (number, str(digest)), {int(n): str(d) for n, d in beyond.items()})
    except (KeyError, TypeError, ValueError, AttributeError):
        raise IgrowError(f"receipts/{chain}.json: no receipt of chain {chain}") from None


def read_receipt(data: bytes, chain: str) -> Receipt:
    """Return the receipt of a chain; raises IgrowError where the file is none of it."""
    return receipt_of(parse_object(data, f"receipts/{chain}.json"), chain)
