"""Fields in which any node may lead: every sensor is at a process of two roles, a member and a header.

Who leads and who measures is settled by radio while the field runs (``head/header.py``, ``node/member.py``); here is
only what each of them is told.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, hypot
from typing import Any, Final

import numpy as np

from launcher.plan.architectures.arranged import Arranged, Hosted, Process
from launcher.plan.architectures.field import Field
from launcher.plan.architectures.periods import Needs, Periods, planned, set_up
from launcher.plan.tracking import if_used, rts_of
from launcher.records import BATTERY, PEER, TRACKS, Polls
from trackfield.errors import ScenarioError
from trackfield.filters.belief import Modes
from trackfield.filters.types import Gaussian
from trackfield.protocols.election import Election
from trackfield.role import NEIGHBOURHOOD, NS
from trackfield.sensing.complete import Kind
from trackfield.tracking.stored import pack
from trackfield.tracking.threshold import LAST_STEP
from trackfield.wire.clusters import BELIEFS_BYTES
from trackfield.wire.codec import encode
from trackfield.wire.peers import MOST_SENSORS
from trackfield.wire.registry import kind_of_class
from trackfield.world.path import Path, State

BASE: Final = "base"
"""The role of the process that is told of the track."""
BEFORE_NEXT: Final = 0.95
"""When in a step the base says where the target was at its instant."""
BACKOFF_NS: Final = Election.backoff_ns
"""That of the weakest claim."""
MODES: Final = 3
"""So many motion models a tracker has that hands over one Gaussian for each."""
AROUND_BYTES: Final = 32
"""What is around beliefs in a message."""
PARTICLES_BYTES: Final = 3700
RESULT_BYTES: Final = 24
MOST_BEYOND: Final = 8
SEARCH: Final = 2
"""Without a track a head has so many times as many sensors measure, as far as the deadline leaves slots for them."""
DIRECT: Final = ("sync-request", "sync-reply")
"""Clocks are set from neighbour to neighbour, not over the tree."""
NEAR_SHARE: Final = 0.05
"""A target so near, in ranges of a sensor, is as loud as any."""


@dataclass(frozen=True)
class Peers:
    """What all such architectures have in common; see the keys of ``[architecture]`` in docs/scenarios.md."""

    base: str = "base"
    multihop: bool = False
    base_every: int = 1
    handover: str = "modes"
    silent_steps: int = 3
    expiry_steps: int = 10
    announcements: int = 3
    sensors: int = 4

    def needs(self, field: Field) -> Needs:
        """What the times of a step depend on."""
        raise NotImplementedError

    def settings(self, field: Field) -> dict[str, Any]:
        """Further ``Settings`` of a header."""
        raise NotImplementedError

    def setup_s(self, field: Field) -> float:
        """See ``SetUp``: nodes announce themselves, in turn, and set their clocks."""
        return float(ceil(set_up(field.site, self.needs(field)).needed_ns / NS))

    def arrange(self, field: Field) -> Arranged:
        """See ``Architecture``; the base comes first."""
        ids = [id for id, *_ in field.sensors]
        _check(field.scenario.architecture.kind, field)
        if self.base in ids:
            raise ScenarioError(f"a sensor has the id of the base, {self.base!r}", key="field", expected="another id")
        plan = planned(field.site, self.needs(field))
        peers = [self._peer(field, plan, number) for number in range(len(ids))]
        views = {"in-network": ids, "base": [self.base]}
        return Arranged([self._base(field, plan), *peers], views, self._polls(field, plan))

    def _polls(self, field: Field, plan: Periods) -> Polls:
        """Who measures when, for what is predicted of a run."""
        own, times, budget = self.settings(field), plan.times, tuple(plan.budget.items())
        return Polls(
            self.sensors,
            own.get("joins", False),
            own.get("sticky", True),
            own.get("keep_within_m"),
            own["short"],
            self.handover,
            bool(own.get("local")),
            self.base,
            plan.base_every,
            self.multihop,
            plan.slot_ns,
            times["beacon_ns"],
            times["preamble_ns"],
            times["turn_ns"],
            plan.election["settle_ns"],
            plan.election["hop_ns"],
            BACKOFF_NS,
            self.silent_steps,
            self.expiry_steps,
            self.announcements,
            times["announce_ns"],
            _peers_m(field),
            (*budget, ("at least", sum(plan.budget.values()))),
        )

    def _needs(self, field: Field, *, short: bool, lease: int) -> Needs:
        sensing = [section.sensing for section in field.site.sections.values()]
        state = 4 + sum(len(kind.unknowns) for kind in sensing)
        trackers = field.scenario.fusion.trackers
        gaussian = _bytes_of(trackers, Gaussian(np.zeros(state), np.eye(state)))
        if gaussian > BELIEFS_BYTES:
            what = f"what {len(trackers)} trackers know takes {gaussian} bytes, and a head says it in {BELIEFS_BYTES}"
            raise ScenarioError(what, key="fusion.trackers", expected="fewer trackers, or shorter names")
        each = Modes(np.ones(MODES) / MODES, np.zeros((MODES, state)), np.tile(np.eye(state), (MODES, 1, 1)))
        handed = {"gaussian": gaussian, "modes": _bytes_of(trackers, each), "particles": PARTICLES_BYTES}
        return Needs(
            len(field.sensors),
            self.sensors,
            max(len(encode(kind.longest())) for kind in sensing),
            RESULT_BYTES if short else AROUND_BYTES + gaussian,
            AROUND_BYTES + handed[self.handover],
            lease,
            self.announcements,
            self.multihop,
            self.base_every,
        )

    # --- what they are told --------------------------------------------------------------------------------------

    def _base(self, field: Field, plan: Periods) -> Process:
        x, y = field.centre
        association = plan.setup.association(len(field.sensors), self.announcements)
        return Process(
            self.base,
            BASE,
            x,
            y,
            config={
                **{"id": self.base, "x_m": x, "y_m": y, "association": association},
                "deadline_ns": round(BEFORE_NEXT * field.site.step_ns),
                **rts_of(field.site),
            },
            sends={"announce": (NEIGHBOURHOOD,)},
            hears=() if self.multihop else ("result", "estimate"),
            fuses=[id for id, *_ in field.sensors],
            tags=(TRACKS,),
            base=self.base if self.multihop else "",
            direct=DIRECT,
            route=field.route,
            draws=self.base,
        )

    def _member(self, field: Field, plan: Periods, number: int) -> dict[str, Any]:
        """The arguments of the member with the sensor of this number."""
        site, (id, x, y), (bx, by) = field.site, field.sensors[number], field.centre
        kind: Kind = site.sections[site.kind_of(number)].sensing
        return {
            "id": id,
            "number": number,
            "step_ns": site.step_ns,
            "slot_ns": plan.slot_ns,
            "keeping": {
                **{"base": self.base, "base_x_m": bx, "base_y_m": by, "away_m": hypot(x - bx, y - by)},
                "start_ns": plan.setup.announce_ns,
                "spread_ns": plan.setup.spread_ns,
                "settled_ns": site.origin_ns,
            },
            **if_used(
                local=bool(self.settings(field).get("local")),
                wakeup=None if self.multihop else dict(plan.wakeup),
                origin_ns=site.origin_ns,
            ),
            **({} if kind.thresholds is None else {"threshold_db": kind.threshold}),
        }

    def _header(self, field: Field, plan: Periods, number: int) -> dict[str, Any]:
        """The arguments of the header of the same node."""
        site, (known, beyond) = field.site, _around(field, number)
        quiet_db, loud_db = loudness_of(site.sections[site.kind_of(number)].sensing)
        settings = {
            "id": field.sensors[number][0],
            "number": number,
            "numbers": known,
            "base": self.base if self.multihop else "",
            "base_every": plan.base_every,
            "count": self.sensors,
            "search": min(SEARCH * self.sensors, plan.slots, MOST_SENSORS),
            "hands": self.handover,
            "silent_steps": self.silent_steps,
            "expiry_steps": self.expiry_steps,
            "announcements": self.announcements,
            "quiet_db": quiet_db,
            "loud_db": loud_db,
            "always_on": self.multihop,
            "beyond": beyond,
            **self.settings(field),
        }
        return {
            "settings": settings,
            "times": dict(plan.times),
            "election": dict(plan.election),
            "deadline_ns": round(field.scenario.fusion.deadline_s * NS),
        }

    def _peer(self, field: Field, plan: Periods, number: int) -> Process:
        """The node with the sensor of this number."""
        id, x, y = field.sensors[number]
        header = self._header(field, plan, number)
        word = "result" if header["settings"]["short"] else "estimate"
        reports = {kind_of_class(one.sensing.message).name for one in field.site.sections.values()}
        takes = (*sorted(reports), *SENT, word)
        sends: dict[str, tuple[str, ...]] = dict.fromkeys(takes, (NEIGHBOURHOOD,))
        if self.multihop:
            sends[word] = (NEIGHBOURHOOD, self.base)
        return Process(
            id,
            PEER,
            x,
            y,
            roles={
                "member": Hosted(config=self._member(field, plan, number), clock="keeps"),
                "header": Hosted(config=header, fuses=True, clock="follows"),
            },
            sends=sends,
            hears=takes,
            senses=True,
            fuses=list(header["settings"]["numbers"]),
            asks=self.base,
            tags=(BATTERY, TRACKS),
            battery_j=field.scenario.energy.battery_j,
            base=self.base if self.multihop else "",
            direct=DIRECT,
            draws=self.base,
        )


SENT: Final = (
    "announce", "claim", "join-claim", "poll", "dissolve", "hand-over", "hand-over-ack", "doubt", "alive",
    "no-target", "local-estimate",
)  # fmt: skip
"""What any node sends to those in reach, besides reports and what a head says of the target."""


def _bytes_of(trackers: Any, belief: Gaussian | Modes) -> int:
    return len(pack(LAST_STEP, None, dict.fromkeys(trackers, belief)))


def _around(field: Field, number: int) -> tuple[dict[str, int], list[list[Any]]]:
    """Numbers of the sensors that may measure with this one, by id: two ranges away at most. And the next ones."""
    (_, x, y), most_m = field.sensors[number], _peers_m(field)
    away = sorted((hypot(ox - x, oy - y), i) for i, (_, ox, oy) in enumerate(field.sensors))
    near = sorted(i for distance, i in away if distance <= most_m)
    known = {field.sensors[i][0]: i for i in near}
    return known, [list(field.sensors[i]) for distance, i in away if distance > most_m][:MOST_BEYOND]


def _peers_m(field: Field) -> float:
    """How far from a sensor those may be that measure with it (m)."""
    return 2.0 * max(section.sensing.range_m for section in field.site.sections.values())


def _check(kind: str, field: Field) -> None:
    """Raise ``ScenarioError`` for sensors that cannot be polled, or whose threshold nobody would set."""
    for name, section in field.site.sections.items():
        sensing, key = section.sensing, "sensor" if len(field.site.sections) == 1 else f"sensors '{name}'"
        if sensing.adaptive:
            what = f"is adaptive, and with architecture {kind} no centre sets it"
            raise ScenarioError(what, key=f"{key}.threshold", expected="a number, or another architecture")
        if section.plays and section.play == "times":
            what = f"is 'times', and with architecture {kind} sensors measure when they are polled"
            raise ScenarioError(what, key=f"{key}.play", expected="'readings', or another architecture")
        if sensing.rhythm == "events" and not sensing.recorded:
            what = f"reports by itself, and with architecture {kind} sensors measure when they are polled"
            raise ScenarioError(
                what, key=f"{key}.kind", expected="sensors with the rhythm 'steps', or another architecture"
            )


def loudness_of(kind: Kind) -> tuple[float, float]:
    """How loud (dB) a target is at the end of a sensor's range, and near it; equal where that is not known."""
    found = [_loud(kind, share * kind.range_m) for share in (0.999, NEAR_SHARE)]
    quiet, loud = (db if db is not None and np.isfinite(db) else 0.0 for db in found)
    return quiet, max(quiet, loud)


class _Still:
    """A scene with one target at rest, east of the origin."""

    def __init__(self, x_m: float) -> None:
        self.state: State = (x_m, 0.0, 0.0, 0.0)
        self.paths: tuple[Path, ...] = ()

    def at(self, t_ns: int) -> list[State]:
        return [self.state]

    def retarded(self, t_ns: int, place: tuple[float, float], speed_m_s: float) -> list[State]:
        return [self.state]

    def alone(self) -> list[Any]:
        return [self]


def _loud(kind: Kind, x_m: float) -> float | None:
    """Of a reading without noise; None: there is none."""
    scene: Any = _Still(x_m)
    values = kind.simulate(scene, 0, (0.0, 0.0), (0.0,) * len(kind.draws or range(kind.n)))
    return None if values is None else float(kind.loudness(kind.z(np.array([values], float)))[0])
