"""A message of each kind that is as long as any, for what radios may be expected to deliver."""

from __future__ import annotations

from typing import Any

from trackfield.errors import ScenarioError
from trackfield.scenario import Site
from trackfield.scenario.nearest import suggestion
from trackfield.wire.codec import encode
from trackfield.wire.messages import SyncReply, SyncRequest, Threshold
from trackfield.wire.registry import kind_of, kinds


def longest(kind: str, site: Site) -> Any:
    """A message of this kind in a run on this site. Raises ``ScenarioError`` for an unknown kind."""
    now_us = site.end_ns // 1000
    match kind:
        case "sync-request":
            return SyncRequest(65535, now_us)
        case "sync-reply":
            return SyncReply(65535, now_us, now_us, now_us)
        case "threshold":
            return Threshold(65535, 70.0)
    reports = [section.sensing.longest() for section in site.sections.values()]
    if mine := [report for report in reports if kind_of(report).name == kind]:
        return max(mine, key=lambda report: len(encode(report)))
    known = {one.name: one for one in kinds()}
    if kind not in known:
        what = f"there is no message {kind!r}{suggestion(kind, known)}"
        raise ScenarioError(what, key="sends", expected=f"one of {', '.join(known)}, or one that its role's module has")
    return known[kind].longest()
