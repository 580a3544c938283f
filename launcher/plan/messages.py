"""The kinds of messages that processes send, and a message of each as long as any, for what radios may deliver."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Final

from launcher.outside import CONTROL
from launcher.plan.architectures import Process
from launcher.plan.payloads import payloads
from trackfield.errors import ScenarioError
from trackfield.filters.measurement import STATE
from trackfield.protocols.collection.piece import KINDS
from trackfield.scenario.nearest import suggestion
from trackfield.sensing.kinds import make_sensor
from trackfield.tracking.forwarding import sent_dimension
from trackfield.wire.codec import encode
from trackfield.wire.messages import Hop, HopAck, Route, SyncReply, SyncRequest, Threshold, Track
from trackfield.wire.outside import Carried, Item
from trackfield.wire.passes import FIXES
from trackfield.wire.registry import kind_of_class, kinds
from trackfield.words import quoted

_ID: Final = b"n000"
SENSORS: Final = 4
"""How many sensors report in a step, as a rule."""


def longest(kind: str, tracking: Mapping[str, Any], end_ns: int) -> Any:
    """A message of this kind, which is known, in a run that ends then; ``tracking`` are the arguments of a ``Bank``.

    It is as long as any, as a rule: a track is a Gaussian, and names the sensors of an ordinary step.
    """
    now_us = end_ns // 1000
    sensing = [make_sensor(**arguments) for arguments in tracking["sensing"].values()]
    reports = [one.longest() for one in sensing if kind_of_class(one.message).name == kind]
    if reports:
        return max(reports, key=lambda message: len(encode(message)))
    match kind:
        case "sync-request" | "sync-reply":
            return SyncRequest(65535, now_us) if kind == "sync-request" else SyncReply(65535, now_us, now_us, now_us)
        case "threshold":
            return Threshold(65535, 70.0)
        case "track":  # of a Gaussian, and the sensors of an ordinary step
            n = sent_dimension(STATE + sum(len(one.unknowns) for one in sensing))
            return Track(now_us, 1000, 255, 1, n, bytes(4 * (n + n * (n + 1) // 2)), bytes(2 * SENSORS))
    if kind in KINDS:
        return _of_tree(kind, max((encode(one.longest()) for one in sensing), key=len))
    known = {one.name: one for one in kinds()}
    fixes = kind in ("item", "carried") and any(one.passes is not None for one in sensing)
    return _with_fix(kind, tracking) if fixes else known[kind].longest()


def _with_fix(kind: str, tracking: Mapping[str, Any]) -> Item | Carried:
    """A message from a gateway to camera control with a fix, or one on its way with that."""
    item = Item(65535, 65535, FIXES, _ID, payloads(tracking)[1])
    return item if kind == "item" else Carried(_ID, CONTROL.encode(), 65535, 255, encode(item))


def _of_tree(kind: str, report: bytes) -> Route | Hop | HopAck:
    """A message of a tree that carries this report, if any."""
    if kind == "route":
        return Route(65535, 99.99, 0, _ID)
    return Hop(_ID, 65535, 9, 99.99, b"", report) if kind == "hop" else HopAck(_ID, 65535)


def check_sent(processes: Iterable[Process], key: str) -> None:
    """Raise ``ScenarioError`` if one of them sends messages of an unknown kind, under the ``key`` of the architecture.

    The roles are loaded by then, and with them the kinds that their modules define.
    """
    known = [one.name for one in kinds()]
    for process in processes:
        for kind in process.sends.keys() - set(known):
            what = f"there is no message {quoted(kind)}{suggestion(kind, known)}"
            expected = f"one of {', '.join(known)}, or one that its role's module has"
            raise ScenarioError(what, key=f"{key}: {process.id}.sends", expected=expected)
