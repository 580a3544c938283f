"""Masters with slaves: whichever is nearest to the target leads, and tells a base over a tree.

Özfidan et al. (2018). Which slave has which master, who leads and who measures is settled by radio while the field
runs (``head``, ``node/slave.py``); here is only where they stand and what they are told.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, hypot, inf
from typing import Any, Final

import numpy as np

from launcher.plan.architectures import slots
from launcher.plan.architectures.arranged import Arranged, Process
from launcher.plan.architectures.field import Field
from launcher.plan.tracking import if_used, rts_of
from launcher.records import BATTERY, MASTER, SLAVE, TRACKS, Schedule
from trackfield.draw import uniform
from trackfield.errors import ScenarioError
from trackfield.filters.types import Gaussian
from trackfield.role import NEIGHBOURHOOD, NS
from trackfield.scenario import Site
from trackfield.sensing.complete import Kind
from trackfield.tracking.stored import pack
from trackfield.tracking.threshold import LAST_STEP
from trackfield.wire.clusters import BELIEFS_BYTES
from trackfield.wire.codec import encode
from trackfield.wire.registry import kind_of_class

BASE: Final = "base"
"""The role of the process that is told of the track."""
NEAREST: Final = 3
"""To so many masters a master sends, as a rule."""
KEPT: Final = 2.5
"""A slave that is not heard of for so many times ``renew_s`` has left."""
PER_MASTER: Final = 4
BEFORE_NEXT: Final = 0.95
"""When in a step the base says where the target was at its instant: what it is told of it has come by then."""
BESIDE_M: Final = 1.0
"""How far a master stands from the sensor that it is beside."""
DIRECT: Final = ("sync-request", "sync-reply")
"""Clocks are set from neighbour to neighbour, not over the tree."""
PARTICLES_BYTES: Final = 3700

Stand = tuple[str, float, float]


@dataclass(frozen=True)
class Clusters:
    """Masters with slaves, the sensors of the field; see the keys of ``[architecture]`` in docs/scenarios.md."""

    masters: int = 0
    placement: str = "among"
    capacity: int = 5
    base: str = "base"
    policy: str = "merge_until_3"
    beacon_every: int = 10
    listen_every: int = 1
    share_every: int = 2
    base_every: int = 0
    timeout_steps: int = 4
    handover: str = "gaussian"
    unasked: bool | None = None
    announcements: int = 3
    renew_s: float = 1800.0
    master_battery_j: float | None = None

    def arrange(self, field: Field) -> Arranged:
        """See ``Architecture``; the base comes first, then the masters."""
        masters = self._stands(field)
        plan = slots.planned(field.site, self.clustered(field.site, len(masters)))
        ids = [id for id, *_ in masters]
        base = self._base(field, plan)
        heads = [self._master(field, plan, masters, one) for one in masters]
        slaves = [self._slave(field, plan, masters, number) for number in range(len(field.sensors))]
        views = {"in-network": ids, "base": [self.base]}
        return Arranged([base, *heads, *slaves], views, self._schedule(plan, masters))

    def _schedule(self, plan: slots.Plan, masters: Sequence[Stand]) -> Schedule:
        """Who measures when, for what is predicted of a run."""
        times, budget = plan.times, plan.budget
        return Schedule(
            tuple(masters),
            self.capacity,
            self.policy,
            self.base,
            times["slot_ns"],
            times["gather_slots"],
            times["beacon_ns"],
            times["preamble_ns"],
            self.beacon_every,
            self.share_every,
            plan.base_every,
            self.handover == "particles",
            self.announcements,
            plan.association["announce_ns"],
            plan.joining["announce_ns"],
            plan.joining["turn_ns"],
            plan.joining["renew_ns"],
            (
                ("reports", budget.reports_ns / NS),
                ("clocks and delays", (budget.deadline_ns - budget.reports_ns) / NS),
                ("hand-over and requests", budget.acts_ns / NS),
                ("beacons", budget.beacon_ns / NS),
                ("at least", budget.least_ns / NS),
            ),
        )

    def setup_s(self, field: Field) -> float:
        """See ``SetUp``: slaves look for masters, in turn."""
        clustered = self.clustered(field.site, len(self._stands(field)))
        return float(ceil(slots.SetUp.of(field.site, clustered).needed_ns / NS))

    # --- where they stand ----------------------------------------------------------------------------------------

    def _stands(self, field: Field) -> list[Stand]:
        """The masters' ids and places."""
        count = self.masters or max(len(field.sensors) // PER_MASTER, 1)
        if self.placement == "among" and count > len(field.sensors):
            what = f"is {count}, and there are {len(field.sensors)} sensors to stand among"
            raise ScenarioError(what, key="architecture.masters", expected=f"at most {len(field.sensors)}")
        places = _spread(field.sensors, count) if self.placement == "among" else _anywhere(field, count)
        digits = len(str(count - 1))
        found = [(f"m{number:0{digits}}", x, y) for number, (x, y) in enumerate(places)]
        if any(id == self.base for id, *_ in found):
            what = f"is {self.base!r}, which is also a master's id"
            raise ScenarioError(what, key="architecture.base", expected="an id that no master has")
        taken = {id for id, *_ in field.sensors} & {self.base, *(id for id, *_ in found)}
        if taken:
            what = f"the sensor {min(taken)!r} has the id of a master or of the base"
            raise ScenarioError(what, key="field", expected="other ids for sensors")
        return found

    def _unasked(self, field: Field) -> bool:
        """Whether slaves report by themselves; unset: if nobody knows where the target starts."""
        return field.scenario.fusion.prior == "none" if self.unasked is None else self.unasked

    def clustered(self, site: Site, masters: int) -> slots.Clustered:
        """What the times of a step depend on."""
        sensing = [section.sensing for section in site.sections.values()]
        state = 4 + sum(len(kind.unknowns) for kind in sensing)
        _check_beliefs(site.scenario.fusion.trackers, state)
        _check_kinds(site)
        belief = 4 * (state + state * (state + 1) // 2) + slots.BELIEF_BYTES
        most, helpers = self._most(masters, len(site.sensors))
        particles = PARTICLES_BYTES if self.handover == "particles" else 0
        return slots.Clustered(
            masters,
            len(site.sensors),
            self.capacity,
            most,
            helpers,
            max(len(encode(kind.longest())) for kind in sensing),
            max(belief * len(site.scenario.fusion.trackers), particles),
            self.share_every,
            self.listen_every,
            self.announcements,
            round(self.renew_s * NS),
            self.policy,
            self.base_every,
        )

    def _most(self, masters: int, slaves: int) -> tuple[int, int]:
        """How many slaves measure in a step at most, and for how many other masters than the leader."""
        match self.policy.rpartition("_"):
            case ("nearest" | "information", _, k):
                return int(k), min(int(k), masters - 1)
            case ("merge_until", _, k):
                return self.capacity + int(k) - 1, min(int(k) - 1, masters - 1)
        if self.policy == "all":
            return slaves, masters - 1
        return self.capacity, min(1, masters - 1)

    # --- what they are told --------------------------------------------------------------------------------------

    def _base(self, field: Field, plan: slots.Plan) -> Process:
        x, y = field.centre
        config = {
            "deadline_ns": round(BEFORE_NEXT * field.site.step_ns),
            "id": self.base,
            "x_m": x,
            "y_m": y,
            "association": self._announcing(plan, 0, 0.0),
            **rts_of(field.site),
        }
        return Process(
            self.base,
            BASE,
            x,
            y,
            config=config,
            sends={"announce": (NEIGHBOURHOOD,)},
            fuses=_ids(field),
            tags=(TRACKS,),
            base=self.base,
            direct=DIRECT,
            route=field.route,
            draws=self.base,
        )

    def _announcing(self, plan: slots.Plan, capacity: int, share: float) -> dict[str, Any]:
        """How a master announces itself, and for how long it keeps slaves; the base does so without any."""
        own = {"capacity": capacity, "share": share, "announcements": self.announcements}
        return {**plan.association, **own, "keep_ns": round(KEPT * self.renew_s * NS)}

    def _master(self, field: Field, plan: slots.Plan, masters: Sequence[Stand], one: Stand) -> Process:
        id, x, y = one
        ids = [id for id, *_ in masters]
        nearest, (bx, by) = _nearest(masters, x, y)[1 : NEAREST + 1], field.centre
        closer = [one for one in masters if hypot(one[1] - bx, one[2] - by) < hypot(x - bx, y - by)]
        asks = _nearest([*closer, (self.base, bx, by)], x, y)[0]
        config: dict[str, Any] = {
            "settings": {
                "id": id,
                "base": self.base,
                "base_x_m": bx,
                "base_y_m": by,
                "masters": [list(stand) for stand in masters],
                "policy": self.policy,
                "beacon_every": self.beacon_every,
                "share_every": self.share_every,
                "base_every": plan.base_every,
                "timeout_steps": self.timeout_steps,
                "particles": self.handover == "particles",
            },
            "times": dict(plan.times),
            "association": self._announcing(plan, self.capacity, (ids.index(id) + 1) / (len(masters) + 1)),
            "deadline_ns": round(field.scenario.fusion.deadline_s * NS),
            **if_used(unasked=self._unasked(field)),
        }
        every = dict.fromkeys(("announce", "admit", "wake", "share", "roster", "doubt"), (NEIGHBOURHOOD,))
        others = dict.fromkeys(("merge", "aggregate", "hand-over", "hand-over-ack", "alive"), nearest)
        return Process(
            id,
            MASTER,
            x,
            y,
            config=config,
            sends={**every, **others, "led-track": (self.base,)},
            hears=("announce", "solicit", "roster", "wake", "share", "doubt"),
            fuses=_ids(field),
            asks=asks,
            tags=(TRACKS,) if self.master_battery_j is None else (TRACKS, BATTERY),
            battery_j=self.master_battery_j,
            base=self.base,
            direct=DIRECT,
            draws=self.base,
        )

    def _slave(self, field: Field, plan: slots.Plan, masters: Sequence[Stand], number: int) -> Process:
        id, x, y = field.sensors[number]
        kind: Kind = field.site.sections[field.site.kind_of(number)].sensing
        master = _nearest(masters, x, y)[0]
        config: dict[str, Any] = {
            "step_ns": field.site.step_ns,
            "slot_ns": plan.times["slot_ns"],
            "joining": {**plan.joining, "id": id, "sensor": number, "x_m": x, "y_m": y, "seed": field.scenario.seed},
            "wakeup": dict(plan.wakeup),
            **if_used(origin_ns=field.site.origin_ns, unasked=self._unasked(field)),
            **({} if kind.thresholds is None else {"threshold_db": kind.threshold}),
        }
        return Process(
            id,
            SLAVE,
            x,
            y,
            config=config,
            sends={
                **dict.fromkeys((kind_of_class(kind.message).name, "no-target", "join"), (master,)),
                "solicit": (NEIGHBOURHOOD,),
            },
            hears=("announce", "admit", "wake"),
            senses=True,
            asks=master,
            tags=(BATTERY,),
            battery_j=field.scenario.energy.battery_j,
        )


def _check_kinds(site: Site) -> None:
    """Raise ``ScenarioError`` for sensors that report passes: at the instants of steps there is nothing to read."""
    for name, section in site.sections.items():
        if section.sensing.passes is not None and not section.sensing.recorded:
            key = "sensor.kind" if len(site.sections) == 1 else f"sensors '{name}'.kind"
            what = "reports passes by itself, and with architecture clusters sensors measure at steps"
            expected = 'another kind, or architecture.kind = "cpa" or "centralised"'
            raise ScenarioError(what, key=key, expected=expected)


def _check_beliefs(trackers: Sequence[str], state: int) -> None:
    """Raise ``ScenarioError`` if what so many trackers of a state of so many numbers know does not fit a message."""
    one = Gaussian(np.zeros(state), np.eye(state))
    size, most = len(pack(LAST_STEP, None, dict.fromkeys(trackers, one))), BELIEFS_BYTES
    if size > most:
        what = f"what {len(trackers)} trackers know takes {size} bytes, and masters share it in a message of {most}"
        raise ScenarioError(what, key="fusion.trackers", expected="fewer trackers, or shorter names")


def _ids(field: Field) -> list[str]:
    return [id for id, *_ in field.sensors]


def _nearest(masters: Sequence[Stand], x: float, y: float) -> list[str]:
    return [id for id, *_ in sorted(masters, key=lambda one: hypot(one[1] - x, one[2] - y))]


def _anywhere(field: Field, count: int) -> list[tuple[float, float]]:
    """Anywhere in the rectangle around the sensors, by the seed."""
    spans = [(min(values), max(values)) for values in zip(*((x, y) for _, x, y in field.sensors), strict=True)]
    seed = field.scenario.seed
    return [
        tuple(low + (high - low) * uniform(seed, "master", number, axis) for axis, (low, high) in enumerate(spans))
        for number in range(count)
    ]


def _spread(sensors: Sequence[Stand], count: int) -> list[tuple[float, float]]:
    """Beside so many of the sensors, each as far as can be from those before it (Gonzalez 1985)."""
    x, y = (sum(values) / len(sensors) for values in zip(*((x, y) for _, x, y in sensors), strict=True))
    away, chosen = [inf] * len(sensors), list[tuple[float, float]]()
    first = min(range(len(sensors)), key=lambda i: hypot(sensors[i][1] - x, sensors[i][2] - y))
    for _ in range(count):
        _, x, y = sensors[first]
        chosen.append((x + BESIDE_M, y))
        away = [min(d, hypot(sx - x, sy - y)) for d, (_, sx, sy) in zip(away, sensors, strict=True)]
        first = max(range(len(sensors)), key=away.__getitem__)
    return chosen
