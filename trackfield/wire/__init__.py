"""The data sent between processes: messages, their bytes, keys and envelopes (docs/wire.md)."""

from __future__ import annotations

from trackfield.wire import clusters, interests, keys, outside, passes, peers
from trackfield.wire.codec import MAX_BYTES, VERSION, decode, encode, kind_name
from trackfield.wire.envelope import Envelope
from trackfield.wire.error import WireError
from trackfield.wire.messages import Doa, Energy, Measurement, Range, Rss, SyncReply, SyncRequest, Threshold, Track
from trackfield.wire.registry import Blob, Scaled, kind

__all__ = [
    "MAX_BYTES",
    "VERSION",
    "Blob",
    "Doa",
    "Energy",
    "Envelope",
    "Measurement",
    "Range",
    "Rss",
    "Scaled",
    "SyncReply",
    "SyncRequest",
    "Threshold",
    "Track",
    "WireError",
    "clusters",
    "decode",
    "encode",
    "interests",
    "keys",
    "kind",
    "kind_name",
    "outside",
    "passes",
    "peers",
]
