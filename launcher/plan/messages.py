"""A message of each kind that is as long as any, for what radios may be expected to deliver."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from trackfield.errors import ScenarioError
from trackfield.filters.measurement import STATE
from trackfield.scenario.nearest import suggestion
from trackfield.sensing.kinds import make_sensor
from trackfield.wire.codec import encode
from trackfield.wire.messages import SyncReply, SyncRequest, Threshold, Track
from trackfield.wire.registry import kind_of_class, kinds

SENSORS: Final = 4
"""How many sensors report in a step, as a rule."""


def longest(kind: str, tracking: Mapping[str, Any], end_ns: int) -> Any:
    """A message of this kind in a run that ends then, by sensors as in ``tracking``, the arguments of a ``Bank``.

    Raises ``ScenarioError`` for an unknown kind.
    """
    now_us = end_ns // 1000
    sensing = [make_sensor(**arguments) for arguments in tracking["sensing"].values()]
    reports = [one.longest() for one in sensing if kind_of_class(one.message).name == kind]
    if reports:
        return max(reports, key=lambda message: len(encode(message)))
    match kind:
        case "sync-request":
            return SyncRequest(65535, now_us)
        case "sync-reply":
            return SyncReply(65535, now_us, now_us, now_us)
        case "threshold":
            return Threshold(65535, 70.0)
        case "track":  # of a Gaussian, and the sensors of an ordinary step
            n = STATE + sum(len(one.unknowns) for one in sensing)
            return Track(now_us, 1000, 255, 1, n, bytes(4 * (n + n * (n + 1) // 2)), bytes(2 * SENSORS))
    known = {one.name: one for one in kinds()}
    if kind not in known:
        what = f"there is no message {kind!r}{suggestion(kind, known)}"
        raise ScenarioError(what, key="sends", expected=f"one of {', '.join(known)}, or one that its role's module has")
    return known[kind].longest()
