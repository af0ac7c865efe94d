"""Bundles from the trainer to the greenhouse, each step mistrusting the one before.

1. `SignedSource` asks the exchange for the site's newest bundle; The Update Framework refuses what is
   tampered with, older than what was seen, expired or signed by somebody else.
2. `Shelf` unpacks it, reads its manifest strictly, checks that it is meant for this site and this version,
   and runs its self-test on this machine: in the process for graphs, with limits, and noted before it begins.
3. `shadow` lets it predict beside the bundle in force, on measurements that neither has seen.
4. `BundleLife` adopts it only if it is not worse, watches it afterwards against its predecessor, and goes
   back by itself; `Bundles` marks a bundle that failed, which is never tried again. Each verdict is an event and a
   report in the exchange.

`BundleUpdates` is all that as the daemon has it: in a thread of its own, which no cycle waits for.
"""

from igrow.edge.updates.fetched import UpdateError
from igrow.edge.updates.rules import UpdateRules
from igrow.edge.updates.service import BundleUpdates
from igrow.edge.updates.shadow import Comparison, Predictor, compare, hindcast_errors
from igrow.edge.updates.shelf import Shelf

__all__ = [
    "BundleUpdates",
    "Comparison",
    "Predictor",
    "Shelf",
    "UpdateError",
    "UpdateRules",
    "compare",
    "hindcast_errors",
]
