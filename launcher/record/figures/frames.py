"""The figures of a run that are about its frames, with types, and what all figures (``measures``) consist of."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Final

from pydantic import BaseModel, ConfigDict, Field

MOST: Final = 1e100
"""The largest number that a figure can have; sums and squares of such numbers are still numbers."""
Number = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-MOST, le=MOST)]
Count = Annotated[int, Field(strict=True, ge=0, lt=1 << 63)]
Signed = Annotated[int, Field(strict=True, ge=-(1 << 63), lt=1 << 63)]
Seed = Annotated[int, Field(strict=True, ge=0, lt=1 << 64)]


class Figures(BaseModel):
    """Figures that belong together; keys that a later version adds are ignored."""

    model_config = ConfigDict(frozen=True, extra="ignore")


class Lost(Figures):
    """Frames that did not reach their receiver, by cause."""

    radio: Count
    partition: Count
    in_flight: Count
    asleep: Count
    frozen: Count
    dead: Count
    overflow: Count
    container: Signed = 0


class Kind(Figures):
    """The frames of one kind of message."""

    sent: Count
    payload_bytes_max: Count


class RoleFrames(Figures):
    """The frames of one role, of processes that have several."""

    delivered: Count | None
    ignored: Count | None


class Frames(Figures):
    """What became of the frames; ``by_kind`` by the name of the message, ``refused`` by the reason, ``by_role`` by the
    name of the role in processes that have several.
    """

    sent: Count
    expected: Count
    delivered: Count
    late: Count
    duplicate: Count | None
    ignored: Count
    lost: Lost
    host_lost: Signed | None
    host_late: Signed | None
    refused: Mapping[str, Count]
    by_kind: Mapping[str, Kind]
    by_role: Mapping[str, RoleFrames]


class Bytes(Figures):
    """Payloads, and what senders put on the air."""

    payload: Count
    on_air: Count | None


class ChannelFigures(Figures):
    """How full the channel was; shares of frames that were overlapped, captured, sent to the deaf, spared."""

    use_mean: Number | None
    use_peak: Number | None
    use_limit: Number | None
    overlapped_share: Number | None
    captured_share: Number | None
    deaf_share: Number | None
    spared_share: Number | None


class Quantiles(Figures):
    """Of a time in ms, emulated."""

    p50: Number | None
    p95: Number | None
    p99: Number | None
    max: Number | None


class Hops(Figures):
    """Emulated times in ms of the ``n`` messages that made as many hops."""

    n: Count
    p50: Number
    p95: Number


class Latencies(Figures):
    """Emulated times in ms: on the link, from sending to fusion, from an instant to the track of it, in the headline
    view and at the base, and of messages over a tree to its base, by the number of their hops.
    """

    link: Quantiles
    to_filter: Quantiles
    to_track: Quantiles
    to_base: Quantiles
    hops: Mapping[str, Hops]
