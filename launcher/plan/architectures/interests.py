"""When nodes that hear targets pass do what, from how long the radio takes for their messages."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import ceil
from typing import Final

from launcher.plan.architectures.periods import SetUp
from launcher.plan.architectures.slots import LEAST_NS, SPARE, air_of
from launcher.plan.hardware import HOP_PATIENCE_NS, slowest_ns
from trackfield.errors import ScenarioError
from trackfield.filters.trackers import make_tracker
from trackfield.role import NS
from trackfield.scenario import Site
from trackfield.scenario.options import tables

AROUND_BYTES: Final = 22
"""What is around a report on its way to a sink, with ids of four bytes (``trackfield/wire/interests.py``)."""
ACK_BYTES: Final = 10
INTEREST_BYTES: Final = 32
LONGEST: Final = 1.5
"""A message is sent again after so many times the patience at most (``trackfield/protocols/interest``)."""
CLOSE_S: Final = 1.5
"""How long after its last pass an event is over, for trackers that do not say it themselves."""
GATHER_NS: Final = NS
"""A new head waits so long for reports, at least."""
TURN_NS: Final = NS // 2
"""By so much each further node of a cluster waits longer before it takes over."""
CROWD: Final = 5
"""So many neighbours hand on a flood one after the other, as a rule."""
SLOW: Final = 4
"""Nodes of a cluster answer an interest at one time: a hop then takes so many times as long."""


@dataclass(frozen=True)
class Pace:
    """What is planned, ns: ``hop_ns`` for a report over a hop, sent again once, and ``patience_ns`` for a single try.

    A flood is handed on within ``jitter_ns``.
    The reports of an event must be with their head ``reports_ns`` after the instant of their step. ``close_ns`` after
    its last pass an event is over; ``gather_ns`` is how long the head of a new cluster waits for reports, ``turn_ns``
    by how much each further node waits longer before it takes over.
    """

    setup: SetUp
    hop_ns: int
    patience_ns: int
    jitter_ns: int
    reports_ns: int
    close_ns: int
    gather_ns: int
    turn_ns: int

    @property
    def times(self) -> Mapping[str, int]:
        """The arguments of the ``Times`` of a head."""
        return {"close_ns": self.close_ns, "gather_ns": self.gather_ns, "turn_ns": self.turn_ns}


def set_up(site: Site, announcements: int) -> SetUp:
    """How a field gets ready: nodes announce themselves, and set their clocks."""
    return SetUp.of(site, len(site.sensors), announcements)


def paced(site: Site, *, report: int, announcements: int, hops: int) -> Pace:
    """The times of a field whose reports have so many bytes and go up to so many hops.

    Raises ``ScenarioError`` if a step, its deadline or the set-up is too short for them.
    """
    air, scenario = air_of(site), site.scenario
    exchange_ns = air.frame_ns(AROUND_BYTES + report) + air.frame_ns(ACK_BYTES)
    patience_ns = HOP_PATIENCE_NS + SLOW * slowest_ns(scenario, repeats=1)
    hop_ns = round(SPARE * exchange_ns) + round(LONGEST * patience_ns)
    reports_ns = hops * hop_ns + air.unsure_ns + LEAST_NS
    _check(site, hops, reports_ns)
    setup = set_up(site, announcements)
    setup.check(site)
    jitter_ns = max(CROWD * air.frame_ns(INTEREST_BYTES), LEAST_NS)
    asked_ns = hops * (jitter_ns + hop_ns)
    return Pace(
        setup,
        hop_ns,
        patience_ns,
        jitter_ns,
        reports_ns,
        round(close_s(site) * NS),
        max(GATHER_NS, 2 * asked_ns),
        max(TURN_NS, asked_ns),
    )


def close_s(site: Site) -> float:
    """The same by the first tracker."""
    fusion = site.scenario.fusion
    first = fusion.trackers[0]
    return float(getattr(make_tracker(first, tables(fusion.options).get(first)), "close_s", CLOSE_S))


def _check(site: Site, hops: int, reports_ns: int) -> None:
    """Raise ``ScenarioError`` unless reports are with their head by the deadline of their step, and before the next."""
    step_s, given_s, low = site.step_ns / NS, site.scenario.fusion.deadline_s, reports_ns / NS
    if low > step_s:
        what = f"is {step_s:g} s, and a report that goes {hops} hops takes up to {low:.2f} s"
        expected = f"at least {ceil(100 * low) / 100:.2f}, a faster radio, or fewer hops (architecture.most_hops)"
        raise ScenarioError(what, key="target.step_s", expected=expected)
    if not low <= given_s <= step_s:
        what = f"is {given_s:g} s, and a report that goes {hops} hops takes up to {low:.2f} s of a step of {step_s:g} s"
        raise ScenarioError(what, key="fusion.deadline_s", expected=f"from {ceil(low * 1e3) / 1e3:g} to {step_s:g}")
