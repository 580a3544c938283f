"""A message of each kind that is as long as any, for what radios may be expected to deliver."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from trackfield.errors import ScenarioError
from trackfield.scenario.nearest import suggestion
from trackfield.sensing.kinds import make_sensor
from trackfield.wire.messages import Doa, Measurement, SyncReply, SyncRequest, Threshold
from trackfield.wire.registry import kinds


def longest(kind: str, tracking: Mapping[str, Any], end_ns: int) -> Any:
    """A message of this kind in a run that ends then, by sensors as in ``tracking``, the arguments of a ``Bank``.

    Raises ``ScenarioError`` for an unknown kind.
    """
    now_us = end_ns // 1000
    match kind:
        case "doa" | "measurement":
            return _report(tracking)
        case "sync-request":
            return SyncRequest(65535, now_us)
        case "sync-reply":
            return SyncReply(65535, now_us, now_us, now_us)
        case "threshold":
            return Threshold(65535, 70.0)
    known = {one.name: one for one in kinds()}
    if kind not in known:
        what = f"there is no message {kind!r}{suggestion(kind, known)}"
        raise ScenarioError(what, key="sends", expected=f"one of {', '.join(known)}, or one that its role's module has")
    return known[kind].longest()


def _report(tracking: Mapping[str, Any]) -> Doa | Measurement:
    """A report that is as long as any; for a user's own sensor, with as many numbers as it measures."""
    if "sensor" not in tracking:
        return Doa(step=65535, bearing_deg=359.99, level_db=70.0)
    return Measurement(65535, (2**15 - 1,) * len(make_sensor(**tracking["sensor"]).resolution))
