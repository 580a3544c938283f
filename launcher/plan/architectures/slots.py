"""When masters and slaves send in a step: slots and times, from how long the radio takes for their messages."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import ceil
from typing import Any, Final, Self

from launcher.plan.hardware import GUARD_SDS, JITTERS, slowest_ns
from trackfield.errors import ScenarioError
from trackfield.link.radios import RADIOS, Radio
from trackfield.link.trace import has_ratios
from trackfield.protocols.association.admitting import TOLD
from trackfield.role import NS
from trackfield.scenario import Site
from trackfield.scenario.links import Csma154, Ethernet, Fixed, GilbertElliott, LognormalPrr, Trace

SPARE: Final = 1.25
"""Slots and waits are so many times what a frame takes."""
SPARSE: Final = 2.0
"""While slaves find masters, a turn is so many times what its messages take: others may answer each other then."""
ROUND: Final = 5.0
"""The same for what masters tell all in reach, one after the other: every process hears it."""
LEAST_NS: Final = 5_000_000
"""The length of a slot where frames take no time, of a window, and of what is allowed for a process to answer."""
ACCESS_NS: Final = 10_000_000
"""What a radio may wait for a channel that is mostly idle."""
HANDOVER_NS: Final = 300_000_000
"""An acknowledgement of a hand-over is waited for so long, or longer on slow radios."""
BUSY: Final = 0.1
"""The share of the time that what the base is told may take."""
HOPS: Final = 3
"""To the base, as a rule."""
BYTES: Final[Mapping[str, int]] = {
    "announce": 16, "roster": 6, "join": 5, "admit": 7, "wake": 24, "merge": 24, "hand-over-ack": 6, "led-track": 140,
    "hop-ack": 10,
}  # fmt: skip
"""Payloads of messages (``trackfield/wire/clusters.py``); of those that depend on the field: below."""
REPORT_BYTES: Final = 3
"""What the report of a sensor is longer by in an ``aggregate``."""
AROUND_BYTES: Final = 12
"""What is around reports and beliefs in a message."""
BELIEF_BYTES: Final = 20
"""What a belief is longer by in a ``hand-over``, with the name of its tracker."""


@dataclass(frozen=True)
class Air:
    """How long a frame may take: by the ``radio``, whose frames are sent up to ``tries`` times, or between two delays.

    ``unsure_ns`` is by how much the clocks of a master and a slave may differ.
    """

    radio: Radio | None
    tries: int
    least_ns: int
    most_ns: int
    unsure_ns: int

    def frame_ns(self, size: int) -> int:
        """For a payload of so many bytes, to arrive."""
        if self.radio is None:
            return max(self.most_ns, LEAST_NS)
        whole, rest = divmod(size, self.radio.payload_bytes)
        parts = [self.radio.payload_bytes] * whole + [rest] * (rest > 0 or not whole)
        one = sum(self.radio.airtime_ns(part + self.radio.overhead_bytes) for part in parts)
        return one + len(parts) * (self.access_ns + (self.tries > 0) * self.radio.ack_ns)

    @property
    def access_ns(self) -> int:
        """How long a sender may wait for the channel."""
        return 0 if self.radio is None or self.radio.access.blind_ns is None else ACCESS_NS


def air_of(site: Site) -> Air:
    """How long frames take on the link of a field."""
    scenario = site.scenario
    link, clock = scenario.link, scenario.clock
    drift = GUARD_SDS * clock.drift_ppm * 1e-6
    kept_ns = drift * min(clock.resync_s * NS, site.end_ns) if clock.sync else drift * site.end_ns
    kept_ns += slowest_ns(scenario) / 4 if clock.sync else GUARD_SDS * clock.offset_ms * 1e6
    unsure_ns = round(kept_ns) if clock.off else 0
    match link:
        case LognormalPrr():
            radio = RADIOS[link.radio](link.sf or 9)
            return Air(radio, radio.ack if link.ack is None else link.ack, 0, 0, unsure_ns)
        case Csma154() | Trace() if isinstance(link, Csma154) or has_ratios(link.file):
            return Air(RADIOS["802154-0dbm"](0), link.ack or 0, 0, 0, unsure_ns)
        case Fixed() | Ethernet():
            return Air(None, 0, round(link.delay_ms * 1e6), round(link.delay_ms * 1e6), unsure_ns)
        case GilbertElliott():
            most_ms = link.delay_ms + JITTERS * link.jitter_ms
            return Air(None, 0, round(link.delay_ms * 1e6), round(most_ms * 1e6), unsure_ns)
    return Air(None, 0, 0, LEAST_NS, unsure_ns)


@dataclass(frozen=True)
class Budget:
    """What of a step is taken by what, ns: ``reports_ns`` by ``slots`` of ``slot_ns``, which must be over by
    ``deadline_ns``; then ``acts_ns`` by a hand-over and what is asked of other masters; at last ``beacon_ns``.
    """

    slots: int
    slot_ns: int
    deadline_ns: int
    acts_ns: int
    beacon_ns: int

    @property
    def reports_ns(self) -> int:
        """All slots."""
        return self.slots * self.slot_ns

    @property
    def least_ns(self) -> int:
        """The shortest step."""
        return self.deadline_ns + self.acts_ns + self.beacon_ns


@dataclass(frozen=True)
class Plan:
    """What is planned: for ``Times`` of masters, ``Wakeup`` of slaves, association, and how often the base is told.

    ``budget`` is what that takes of a step.
    """

    times: Mapping[str, int]
    wakeup: Mapping[str, Any]
    association: Mapping[str, int]
    joining: Mapping[str, int]
    base_every: int
    budget: Budget


@dataclass(frozen=True)
class Clustered:
    """What the times depend on: how many ``masters`` and ``slaves``, ``capacity``, sensors in a step, other options.

    ``fewest`` is how many slaves measure at most, ``helpers`` how many other masters hear them. ``report`` and
    ``belief`` are the bytes of a report and of all beliefs.
    """

    masters: int
    slaves: int
    capacity: int
    most: int
    helpers: int
    report: int
    belief: int
    share_every: int
    listen_every: int
    announcements: int
    renew_ns: int
    policy: str
    base_every: int


def sizes_of(field: Clustered) -> dict[str, int]:
    """The bytes of messages by kind; of reports all that a cluster has in one."""
    return {
        **BYTES,
        "wake": BYTES["wake"] + field.capacity,
        "aggregate": AROUND_BYTES + field.capacity * (field.report + REPORT_BYTES),
        "hand-over": AROUND_BYTES + field.belief,
        "share": AROUND_BYTES + field.belief,
        "roster": BYTES["roster"] + 2 * field.capacity,
    }


def budget_of(air: Air, field: Clustered, step_ns: int) -> Budget:
    """What reports, a hand-over and beacons take of a step, whether they fit it or not."""
    sizes = sizes_of(field)
    slot_ns = slot_ns_of(air, field.report)
    slots = field.most + field.helpers * ceil(air.frame_ns(sizes["aggregate"]) / slot_ns)
    deadline_ns = slots * slot_ns + (air.most_ns if air.radio is None else 0) + air.unsure_ns + LEAST_NS
    asks_ns = min(field.helpers, 2) * air.frame_ns(BYTES["merge"])
    acts_ns = _handed_ns(air, sizes) + asks_ns
    return Budget(slots, slot_ns, deadline_ns, acts_ns, step_ns - beacon_ns_of(air, sizes["wake"], step_ns)[0])


def slot_ns_of(air: Air, report: int) -> int:
    """How long a slot for a report of so many bytes is."""
    return max(round(SPARE * air.frame_ns(report)), LEAST_NS) if air.radio else LEAST_NS


def _handed_ns(air: Air, sizes: Mapping[str, int]) -> int:
    """How long a hand-over and its acknowledgement take."""
    return air.frame_ns(sizes["hand-over"]) + air.frame_ns(sizes["hand-over-ack"]) + 2 * LEAST_NS


def beacon_ns_of(air: Air, size: int, step_ns: int) -> tuple[int, int]:
    """When in a step beacons of so many bytes leave, and when those that sleep begin to listen for them."""
    if air.radio is None:
        beacon_ns = step_ns - air.most_ns - 2 * air.unsure_ns - 2 * LEAST_NS
        return beacon_ns, beacon_ns + air.least_ns - air.unsure_ns
    unsure_ns = air.unsure_ns + air.access_ns
    window_ns = step_ns - air.frame_ns(size) - unsure_ns - 2 * LEAST_NS
    return window_ns - unsure_ns, window_ns


def window_of(air: Air, site: Site, every: int, window_ns: int) -> tuple[dict[str, Any], int]:
    """The arguments of the ``Wakeup`` of those that listen so long after the instant of every so many steps.

    Also by how much longer the preambles of beacons are.
    """
    unsure_ns, open_ns = (0 if air.radio is None else air.unsure_ns + air.access_ns), LEAST_NS
    if air.radio is None:
        open_ns += 2 * air.unsure_ns + air.most_ns - air.least_ns
    else:
        open_ns = max(open_ns, 2 * air.radio.detect_ns)
    detect_ns, spare_ns = (0, 0) if air.radio is None else (air.radio.detect_ns, _spare_ns(air.radio))
    wakeup = {
        "every_ns": every * site.step_ns,
        "open_ns": open_ns,
        "from_ns": site.origin_ns + window_ns,
        "detect_ns": detect_ns,
        "spare_ns": spare_ns,
        "unsure_ns": unsure_ns,
    }
    return wakeup, max(2 * unsure_ns - spare_ns, 0)


@dataclass(frozen=True)
class SetUp:
    """How slaves find masters, ns: masters announce themselves for ``announce_ns``, then set their clocks, one each
    ``clock_ns``; at ``joins_ns`` the turns of the slaves begin, of ``turn_ns`` each. All is done by ``needed_ns``.
    """

    announce_ns: int
    clock_ns: int
    joins_ns: int
    turn_ns: int
    patience_ns: int
    answers_ns: int
    needed_ns: int

    @classmethod
    def of(cls, site: Site, field: Clustered) -> Self:
        """That of a field."""
        air, clock = air_of(site), site.scenario.clock
        longest_ns = max(air.frame_ns(BYTES["announce"]), air.frame_ns(BYTES["roster"] + 2 * field.capacity))
        round_ns = max(round(ROUND * (field.masters + 1) * longest_ns), NS // 2)
        announce_ns, exchange_ns = field.announcements * round_ns, _exchange_ns(air)
        patience_ns = round(SPARE * exchange_ns) + 4 * LEAST_NS
        sync_ns = clock.exchanges * slowest_ns(site.scenario) if clock.off and clock.sync else 0
        turn_ns = max(round(SPARSE * exchange_ns) + sync_ns + 4 * LEAST_NS, patience_ns)
        clock_ns = round(SPARE * sync_ns)
        joins_ns = announce_ns + field.masters * clock_ns
        needed_ns = joins_ns + field.slaves * turn_ns + TOLD * round_ns + (NS + 2 * sync_ns if sync_ns else 0)
        answers_ns = max(8 * air.frame_ns(BYTES["announce"]), NS // 2)
        return cls(announce_ns, clock_ns, joins_ns, turn_ns, patience_ns, answers_ns, needed_ns)


def _exchange_ns(air: Air) -> int:
    """A request of a slave, and its answer."""
    return air.frame_ns(BYTES["join"]) + air.frame_ns(BYTES["admit"])


def planned(site: Site, field: Clustered) -> Plan:
    """The times of a field. Raises ``ScenarioError`` if a step, its deadline or the set-up is too short for them."""
    air, step_ns, sizes = air_of(site), site.step_ns, sizes_of(field)
    budget = budget_of(air, field, step_ns)
    least_ns = HANDOVER_NS if step_ns >= 2 * NS else min(HANDOVER_NS, step_ns // 8)
    handover_ns = max(least_ns, _handed_ns(air, sizes))
    beacon_ns, window_ns = beacon_ns_of(air, sizes["wake"], step_ns)
    _check(site, field, budget)
    setup = SetUp.of(site, field)
    needed_ns = setup.needed_ns
    if site.origin_ns < needed_ns:
        what = f"is {site.origin_ns / NS:g} s, and {field.slaves} slaves take {needed_ns / NS:.1f} s to find masters"
        raise ScenarioError(what, key="run.setup_s", expected=f"at least {ceil(needed_ns / NS)}")
    wakeup, preamble_ns = window_of(air, site, field.listen_every, window_ns)
    times = {
        "slot_ns": budget.slot_ns,
        "slots": budget.slots,
        "gather_slots": ceil(air.frame_ns(sizes["aggregate"]) / budget.slot_ns),
        "beacon_ns": beacon_ns,
        "preamble_ns": preamble_ns,
        "handover_ns": handover_ns,
        "frame_ns": air.frame_ns(sizes["hand-over"]),
        "late_ns": air.unsure_ns + (air.most_ns if air.radio is None else 0),
        "clock_ns": setup.clock_ns,
    }
    association = {
        "announce_ns": setup.announce_ns,
        "answers_ns": setup.answers_ns,
        "setup_ns": setup.joins_ns + field.slaves * setup.turn_ns,
    }
    joining = {
        "announce_ns": setup.joins_ns,
        "turn_ns": setup.turn_ns,
        "patience_ns": setup.patience_ns,
        "answers_ns": setup.answers_ns + setup.patience_ns,
        "again_ns": 10 * field.listen_every * step_ns,
        "renew_ns": field.renew_ns,
    }
    base_every = field.base_every or _base_every(air, step_ns, field.share_every)
    return Plan(times, wakeup, association, joining, base_every, budget)


def _spare_ns(radio: Radio) -> int:
    return max(radio.preamble_ns - radio.detect_ns, 0)


def _base_every(air: Air, step_ns: int, share_every: int) -> int:
    """Every how many steps the base is told; not at those at which the belief is shared, if that is not at each."""
    every = base_every_of(air, BYTES["led-track"], step_ns)
    return every if every == 1 or share_every == 1 else share_every * ceil(every / share_every)


def base_every_of(air: Air, size: int, step_ns: int) -> int:
    """The same for what has so many bytes, at any step."""
    if air.radio is None:
        return 1
    cost_ns = HOPS * (air.frame_ns(size) + air.frame_ns(BYTES["hop-ack"]))
    return ceil(cost_ns / (BUSY * step_ns))


def _check(site: Site, field: Clustered, budget: Budget) -> None:
    """Raise ``ScenarioError`` if reports, hand-over and beacons do not fit a step, or the reports the deadline."""
    step_s, least_s = site.step_ns / NS, budget.least_ns / NS
    parts = (
        f"reports of up to {field.most} slaves {budget.reports_ns / NS:.2f} s, a hand-over and what is asked of other "
        f"masters {budget.acts_ns / NS:.2f} s, beacons {budget.beacon_ns / NS:.2f} s"
    )
    if budget.least_ns > site.step_ns:
        what = f"is {step_s:g} s, and policy '{field.policy}' takes {least_s:.2f} s of radio time ({parts})"
        expected = f"at least {ceil(100 * least_s) / 100:.2f}, a faster radio, or another policy"
        raise ScenarioError(what, key="target.step_s", expected=expected)
    most_ns = site.step_ns - budget.acts_ns - budget.beacon_ns
    given_ns = round(site.scenario.fusion.deadline_s * NS)
    if not budget.deadline_ns <= given_ns <= most_ns:
        what = f"is {given_ns / NS:g} s, and policy '{field.policy}' takes {parts} of a step of {step_s:g} s"
        expected = f"from {ceil(budget.deadline_ns / 1e6) / 1e3:g} to {int(most_ns / 1e6) / 1e3:g}"
        raise ScenarioError(what, key="fusion.deadline_s", expected=expected)
