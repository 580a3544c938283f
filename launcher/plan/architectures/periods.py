"""When nodes of which any may lead send in a step, from how long the radio takes for their messages."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import ceil
from typing import Any, Final, Self

from launcher.plan.architectures.slots import (
    HANDOVER_NS,
    LEAST_NS,
    SPARSE,
    air_of,
    base_every_of,
    beacon_ns_of,
    slot_ns_of,
    window_of,
)
from launcher.plan.hardware import PATIENCE_NS, slowest_ns
from trackfield.errors import ScenarioError
from trackfield.protocols.election import settling_ns
from trackfield.role import NS
from trackfield.scenario import Site

POLL_BYTES: Final = 11
"""Of a poll without its sensors, two bytes each."""
RESULT_BYTES: Final = 24
CLAIM_BYTES: Final = 20
ACK_BYTES: Final = 6
ANNOUNCE_BYTES: Final = 16
SYNC_BYTES: Final = 20
TURN_NS: Final = 100_000_000
"""So long after each other nodes announce themselves, which all in reach hear."""
STRATA: Final = 4
"""So many hops from the base the clocks are set, as a rule."""
TREE_NS: Final = 20 * NS
"""In so long a tree to the base is there, as a rule."""


@dataclass(frozen=True)
class Needs:
    """What the times depend on: ``nodes``, how many ``sensors`` measure, bytes of a report, of what a head tells all,
    and of a hand-over; the ``lease`` in steps. The base is told over the tree every ``base_every`` steps; 0: as the
    radio allows.
    """

    nodes: int
    sensors: int
    report: int
    word: int
    handed: int
    lease: int
    announcements: int
    multihop: bool
    base_every: int = 1


@dataclass(frozen=True)
class Periods:
    """What is planned, ns: the ``times`` of headers, windows of members, elections, and what of a step takes what.

    Of the ``slots`` of ``slot_ns`` that end before the deadline as many are needed as sensors measure.
    """

    times: Mapping[str, int]
    wakeup: Mapping[str, Any]
    election: Mapping[str, int]
    slot_ns: int
    setup: SetUp
    base_every: int
    budget: Mapping[str, float]
    slots: int


@dataclass(frozen=True)
class SetUp:
    """How a field gets ready, ns: nodes announce themselves for ``announce_ns``, then begin to ask for the time, spread
    over ``spread_ns``; all is done at ``needed_ns``.
    """

    announce_ns: int
    spread_ns: int
    needed_ns: int

    @classmethod
    def of(cls, site: Site, nodes: int, announcements: int, then_ns: int = 0) -> Self:
        """That of a field of so many nodes; what they do ``then`` takes as long as that."""
        air, clock = air_of(site), site.scenario.clock
        one_ns = max(round(SPARSE * air.frame_ns(ANNOUNCE_BYTES)), TURN_NS)
        announce_ns = announcements * max((nodes + 1) * one_ns, NS // 2)
        if not (clock.off and clock.sync):
            return cls(announce_ns, 0, announce_ns + then_ns)
        exchange_ns = round(SPARSE * 2 * air.frame_ns(SYNC_BYTES))
        spread_ns = max(nodes * clock.exchanges * exchange_ns, NS)
        rounds_ns = STRATA * 2 * clock.exchanges * (PATIENCE_NS + 2 * slowest_ns(site.scenario))
        return cls(announce_ns, spread_ns, announce_ns + spread_ns + rounds_ns + then_ns)

    def association(self, nodes: int, announcements: int) -> dict[str, Any]:
        """The arguments of the ``Admitting`` of a base, which comes after so many nodes, and admits no slave."""
        return {
            **{"announcements": announcements, "announce_ns": self.announce_ns, "setup_ns": self.announce_ns},
            **{"capacity": 0, "answers_ns": NS, "keep_ns": NS, "share": nodes / (nodes + 1)},
        }

    def check(self, site: Site) -> None:
        """Raise ``ScenarioError`` if the first step is before the field is ready."""
        if site.origin_ns < self.needed_ns:
            needed_s = self.needed_ns / NS
            what = (
                f"is {site.origin_ns / NS:g} s, and it takes {needed_s:.1f} s until nodes know their peers and the time"
            )
            raise ScenarioError(what, key="run.setup_s", expected=f"at least {ceil(needed_s)}")


def set_up(site: Site, needs: Needs) -> SetUp:
    """How a field gets ready in which any node may lead."""
    return SetUp.of(site, needs.nodes, needs.announcements, TREE_NS if needs.multihop else 0)


def planned(site: Site, needs: Needs) -> Periods:
    """The times of a field. Raises ``ScenarioError`` if a step, its deadline or the set-up is too short for them."""
    air, step_ns = air_of(site), site.step_ns
    slot_ns = slot_ns_of(air, needs.report)
    spare_ns = air.most_ns if air.radio is None else 0
    reports_ns = needs.sensors * slot_ns + spare_ns + air.unsure_ns + LEAST_NS
    word_ns, handed_ns = air.frame_ns(needs.word), air.frame_ns(needs.handed) + air.frame_ns(ACK_BYTES) + 2 * LEAST_NS
    beacon_ns, window_ns = beacon_ns_of(air, POLL_BYTES + 2 * needs.sensors, step_ns)
    given_ns = round(site.scenario.fusion.deadline_s * NS)
    budget = {
        "reports": reports_ns / NS,
        "what the head tells all": word_ns / NS,
        "a hand-over": handed_ns / NS,
        "polls": (step_ns - beacon_ns) / NS,
    }
    _check(site, needs, budget, given_ns)
    setup = set_up(site, needs)
    setup.check(site)
    frame_ns = air.frame_ns(CLAIM_BYTES)
    hop_ns = max(frame_ns if air.radio is None else 4 * frame_ns, 4 * LEAST_NS)  # relays share a radio's channel
    told_ns = given_ns + word_ns + spare_ns + air.unsure_ns + LEAST_NS
    wakeup, preamble_ns = window_of(air, site, 1, window_ns)
    times = {
        "beacon_ns": beacon_ns,
        "preamble_ns": preamble_ns,
        "handover_ns": max(min(HANDOVER_NS, (beacon_ns - given_ns - word_ns) // 2), handed_ns),
        "word_ns": max(step_ns // 2, told_ns),
        "slot_ns": slot_ns,
        "turn_ns": 2 * frame_ns + 2 * LEAST_NS,
        "lease_ns": needs.lease * step_ns + step_ns // 4,
        "announce_ns": setup.announce_ns,
        "nodes": needs.nodes,
    }
    election = {"hop_ns": hop_ns, "settle_ns": settling_ns(frame_ns, hop_ns=hop_ns, jitter_ns=10_000_000)}
    base_every = needs.base_every or base_every_of(air, needs.word, step_ns)
    slots = (given_ns - reports_ns) // slot_ns + needs.sensors
    return Periods(times, wakeup, election, slot_ns, setup, base_every, budget, slots)


def _check(site: Site, needs: Needs, budget: Mapping[str, float], given_ns: int) -> None:
    """Raise ``ScenarioError`` if all that does not fit a step, or the reports the deadline."""
    step_s, least_s, given_s = site.step_ns / NS, sum(budget.values()), given_ns / NS
    parts = ", ".join(f"{name} {took:.2f} s" for name, took in budget.items())
    if least_s > step_s:
        what = f"is {step_s:g} s, and with {needs.sensors} sensors that measure it takes {least_s:.2f} s ({parts})"
        expected = f"at least {ceil(100 * least_s) / 100:.2f}, a faster radio, or fewer sensors"
        raise ScenarioError(what, key="target.step_s", expected=expected)
    low, high = budget["reports"], step_s - least_s + budget["reports"]
    if not low <= given_s <= high:
        what = f"is {given_s:g} s, and of a step of {step_s:g} s are taken: {parts}"
        expected = f"from {ceil(low * 1e3) / 1e3:g} to {int(high * 1e3) / 1e3:g}"
        raise ScenarioError(what, key="fusion.deadline_s", expected=expected)
