"""The exchange: what gateway and trainer leave for each other, and what both sides agree on about it.

Beneath an address (a folder, `sftp://` or `s3://`, see `address.py`) each site has a folder of its own, so that an
account, a chroot or a bucket policy can show one grower's gateway its own site and nothing else:

    <site>/segments/<chain>-<number>-<sha256>.zip   a sealed piece of the log          gateway -> trainer
    <site>/receipts/<chain>.json                    which of them the trainer has      trainer -> gateway
    <site>/reports/<time>-<name>.json               what became of a bundle            gateway -> trainer
    <site>/bundles/metadata, .../targets            signed bundles (TUF)               trainer -> gateway

A segment is written once and never changed. Its seal names the one before by its digest, so that what is missing, cut,
repeated or forged shows; it stays with the gateway until a receipt names it, and the trainer deletes it from the
exchange once it holds it safely. So no listing grows with history, whatever is sent again.
"""

from igrow.core.exchange.errors import DamagedError, ExchangeError, SegmentError
from igrow.core.exchange.place import Below, Entry, FolderPlace, Place
from igrow.core.exchange.receipt import Receipt, read_receipt
from igrow.core.exchange.seal import Seal, SegmentName
from igrow.core.exchange.segment import Segment, open_segment, pack_segment

__all__ = [
    "Below",
    "DamagedError",
    "Entry",
    "ExchangeError",
    "FolderPlace",
    "Place",
    "Receipt",
    "Seal",
    "Segment",
    "SegmentError",
    "SegmentName",
    "open_segment",
    "pack_segment",
    "read_receipt",
]
