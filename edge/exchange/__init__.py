"""The exchange with the trainer, in a process of its own: nothing it does can hold the control cycle or the stop.

The daemon (`service.py`) starts a courier now and then and ends it when it takes too long; whatever hangs, a share or
a server, hangs there. The courier (`courier.py`) makes one round:

1. it seals the log's complete days (or hours) into the outbox, a folder of the gateway's own disk (`outbox.py`);
2. it sends what has not arrived, and forgets what the trainer's receipts name;
3. it sends the reports on bundles, and copies the signed bundles to the gateway's own disk, where the updates
   check them (`igrow.edge.updates`): the daemon itself never touches the exchange.

A round that is cut short anywhere is made good by the next one. `igrow.core.exchange` says what travels.
"""

from igrow.edge.exchange.courier import Order, run_round
from igrow.edge.exchange.service import ExchangeService

__all__ = ["ExchangeService", "Order", "run_round"]
