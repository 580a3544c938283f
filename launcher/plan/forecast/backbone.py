"""The backbone beyond a gateway: what each of its links delivers, and how long a message takes over several of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import dist
from statistics import median
from typing import Any, Final

from launcher.outside import CONTROL, GATEWAY
from launcher.plan.forecast.graph import CARRIES
from launcher.plan.forecast.reception import shares_of
from launcher.plan.forecast.ways import Pair
from launcher.records import BACKBONE, Flow, Plan
from trackfield.drivers.spec import ProcessSpec, link_of
from trackfield.errors import ScenarioError
from trackfield.link.fate import Transmission
from trackfield.role import NS
from trackfield.wire.codec import encode
from trackfield.wire.registry import kind_of

GOOD: Final = 0.9
"""A link that delivers a smaller share of its messages is worth a warning: each is then waited for and sent again."""
TRIALS: Final = 20
"""Messages that are sent on trial over each link."""


@dataclass(frozen=True)
class Backbone:
    """That of a ``plan`` with a ``gateway`` from which fixes go to a ``control``."""

    plan: Plan
    gateway: ProcessSpec
    control: ProcessSpec

    @classmethod
    def of(cls, plan: Plan) -> Backbone | None:
        """That of a plan; None if nothing is beyond its field."""
        first = {process.role: process for process in reversed(plan.processes)}
        ends = first.get(GATEWAY), first.get(CONTROL)
        return None if ends[0] is None or ends[1] is None else cls(plan, ends[0], ends[1])

    @cached_property
    def shares(self) -> Mapping[Pair, float]:
        """The share of its messages that each link delivers, by (from, to); of several kinds the least."""
        found: dict[Pair, float] = {}
        for flow in self._flows:
            for pair, share in shares_of(self.plan, flow, None).items():
                found[pair] = min(share, found.get(pair, 1.0))
        return found

    @property
    def _flows(self) -> list[Flow]:
        return [flow for flow in self.plan.flows if flow.medium == BACKBONE and not flow.near]

    @cached_property
    def way(self) -> tuple[Pair, ...]:
        """The links from the gateway to camera control."""
        ids, to = [self.gateway.id], self.control.id
        while ids[-1] != to:
            ids.append(self._carries(ids[-1]).get("next", {}).get(to, to))
        return tuple(pairwise(ids))

    @cached_property
    def after_s(self) -> float:
        """How long a fix takes over the backbone, if nothing of it is lost: by medians, as each node holds it."""
        holds_ns = sum(self._carries(src).get("hold_ns", 0) for src, _ in self.way[1:])
        return float(sum(map(self._takes_ns, self.way)) + holds_ns) / NS

    def _carries(self, id: str) -> Mapping[str, Any]:
        return next(process.carries for process in self.plan.processes if process.id == id)

    def _takes_ns(self, pair: Pair) -> float:
        message = max((f.message for f in self._flows if pair in f.pairs), key=lambda one: len(encode(one)))
        kind, size = kind_of(message).name, len(encode(message))
        link, end_ns = link_of(self.plan.run, self.plan.processes, cut=False), self.plan.run.end_ns
        sent = (Transmission(*pair, kind, end_ns * n // TRIALS, 0, size, medium=BACKBONE) for n in range(TRIALS))
        delays = [fate.delay_ns for fate in map(link.fate, sent) if fate.cause is None]
        return float(median(delays)) if delays else 0.0

    # --- what may go wrong -------------------------------------------------------------------------------------------

    def check(self) -> None:
        """Raise ``ScenarioError`` if a link delivers less than half of its messages: of the worst one."""
        pair = min(self.shares, key=lambda pair: self.shares[pair])
        if self.shares[pair] >= CARRIES:
            return
        what = (
            f"on the backbone {pair[0]} and {pair[1]} are {self._apart_m(pair):.0f} m apart, and "
            f"{self.shares[pair]:.0%} of the messages arrive"
        )
        expected = f"links that deliver at least {CARRIES:.0%}: nodes between them (camera.hops), or more power"
        raise ScenarioError(what, key="camera.hops" if len(self.way) > 1 else "backbone", expected=expected)

    def doubtful(self) -> Iterator[str]:
        """Links that lose messages, the worst one by name."""
        poor = [pair for pair, share in self.shares.items() if share < GOOD]
        if poor:
            worst = min(poor, key=lambda pair: self.shares[pair])
            yield (
                f"{len(poor)} of {len(self.shares)} links of the backbone lose more than {1 - GOOD:.0%} of the "
                f"messages (worst: {' to '.join(worst)}, {self._apart_m(worst):.0f} m, {self.shares[worst]:.0%} "
                "arrive): fixes are sent again, and come late"
            )

    def _apart_m(self, pair: Pair) -> float:
        places = {place.id: (place.x, place.y) for place in self.plan.info.places}
        return dist(places[pair[0]], places[pair[1]])


def check_backbone(plan: Plan) -> None:
    """Raise ``ScenarioError`` if fixes cannot get from the gateway to camera control, or orders to their processes."""
    backbone = Backbone.of(plan)
    if backbone is not None:
        backbone.check()
