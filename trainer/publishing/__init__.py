"""Publishing: signing keys, and the signed repository of a site's bundles in the exchange.

create_keys(keys)                          once, on the machine that signs; its 1.root.json goes onto each gateway
publish(bundle, exchange, keys)            for each bundle
refresh(repository, keys)                  at least every few weeks, so that gateways see that nobody holds
                                           news back from them
"""

from igrow.trainer.publishing.keys import ROLES, PublishingError, create_keys
from igrow.trainer.publishing.publish import publish, repository_of
from igrow.trainer.publishing.repository import initialise, publish_in, refresh

__all__ = ["ROLES", "PublishingError", "create_keys", "initialise", "publish", "publish_in", "refresh", "repository_of"]
