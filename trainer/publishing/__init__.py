"""Publishing: signing keys, the signed repository of bundles, and the exchange as the trainer sees it.

create_keys(keys)                          once, on the machine that signs
initialise(repository, keys)               once; gives root.json, which is installed on each gateway
publish(bundle, repository, keys)          for each bundle
refresh(repository, keys)                  at least every few weeks, so that gateways see that nobody holds
                                           news back from them
read_exchange(root, site)                  the log of a gateway
"""

from igrow.trainer.publishing.exchange import ExchangeLog, read_exchange
from igrow.trainer.publishing.keys import ROLES, PublishingError, create_keys
from igrow.trainer.publishing.repository import Lifetimes, initialise, publish, refresh

__all__ = [
    "ROLES",
    "ExchangeLog",
    "Lifetimes",
    "PublishingError",
    "create_keys",
    "initialise",
    "publish",
    "read_exchange",
    "refresh",
]
