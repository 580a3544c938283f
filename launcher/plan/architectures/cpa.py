"""Sensors that hear targets pass, in clusters whose heads say where each passed (Yang et al., section 3).

Who leads is settled by radio while the field runs (``head/hearing/``, ``node/ear.py``), and who sends what to whom by
directed diffusion (``trackfield/protocols/interest/``); here is only what each process is told.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import ceil, dist, hypot
from typing import Any, Final

from launcher.plan.architectures.arranged import Arranged, Hosted, Process
from launcher.plan.architectures.field import Field
from launcher.plan.architectures.interests import Pace, paced, set_up
from launcher.plan.architectures.outside import outside_of
from launcher.plan.tracking import if_used, spline_of
from launcher.records import BATTERY, EAR, TRACKS, Passing
from trackfield.errors import ScenarioError
from trackfield.role import NEIGHBOURHOOD, NS
from trackfield.scenario import Site
from trackfield.wire.codec import encode
from trackfield.wire.interests import MOST_HOPS
from trackfield.wire.passes import CpaReport, CpaReportSds
from trackfield.wire.registry import kind_of_class
from trackfield.world.events import ENOUGH

SINK: Final = "sink"
"""The role of the base."""
FIXED_HOPS: Final = 4
"""Through a cluster, and to the head of the next one."""
LOUDEST_HOPS: Final = 2
HOPS: Final = 2
"""A report goes so many hops to its head, as a rule."""
NEXT: Final = 2.0
"""Heads of clusters that are so many times as far away as the nearest one send this one their fixes."""
MARGIN_M: Final = 1.0
"""By so much the region of an interest is larger than its cluster."""
BEFORE_NEXT: Final = 0.95
"""When in a step the base says where the target was at its instant."""
SENT: Final = ("announce", "interest", "data", "reinforce", "data-ack")
"""What any process sends to those in reach, besides reports that all of them hear."""

Group = tuple[str, ...]


@dataclass(frozen=True)
class Cpa:
    """See the keys of ``[architecture]`` in docs/scenarios.md."""

    base: str = "base"
    heads: str = "fixed"
    size: int = 5
    interest_s: float = 9.0
    most_hops: int | None = None
    reports: int = 5
    announcements: int = 3

    @property
    def hops(self) -> int:
        """How many hops an interest of a head goes."""
        return self.most_hops or (FIXED_HOPS if self.heads == "fixed" else LOUDEST_HOPS)

    def setup_s(self, field: Field) -> float:
        """See ``SetUp``: nodes announce themselves, set their clocks, and hear the first interests."""
        return float(ceil(set_up(field.site, self.announcements).needed_ns / NS))

    def arrange(self, field: Field) -> Arranged:
        """See ``Architecture``; the base comes first."""
        _check(field)
        ids = [id for id, *_ in field.sensors]
        if self.base in ids:
            raise ScenarioError(f"a sensor has the id of the base, {self.base!r}", key="field", expected="another id")
        told, outside = _Told(self, field, self._groups(ids)), outside_of(field, self.base)
        views = {"in-network": ids, "base": [self.base]}
        base = told.sink() if outside is None else outside.gateway(told.sink(), SINK)
        beyond = [] if outside is None else outside.processes
        return Arranged([base, *map(told.ear, range(len(ids))), *beyond], views, told.passing)

    def _groups(self, ids: Sequence[str]) -> tuple[Group, ...]:
        """The fixed clusters, each of ``size`` sensors in their order; of the loudest there are none."""
        if len(ids) < ENOUGH:
            expected = f"at least {ENOUGH}, as many as a fix takes reports"
            raise ScenarioError(f"the field has {len(ids)} sensors", key="field", expected=expected)
        if self.heads != "fixed":
            return ()
        groups = tuple(tuple(ids[i : i + self.size]) for i in range(0, len(ids), self.size))
        if len(groups[-1]) < ENOUGH:
            what = f"is {self.size}, and of {len(ids)} sensors the last {len(groups[-1])} are a cluster of their own"
            expected = f"a size of which every cluster has at least {ENOUGH} sensors, or heads = 'loudest'"
            raise ScenarioError(what, key="architecture.size", expected=expected)
        return groups


@dataclass(frozen=True)
class _Told:
    """What the processes of a field are told; fixed clusters are ``groups`` of their sensors' ids."""

    of: Cpa
    field: Field
    groups: tuple[Group, ...]

    @cached_property
    def pace(self) -> Pace:
        """When they do what."""
        longest = max(len(encode(one.sensing.longest())) for one in self._site.sections.values())
        of = self.of
        return paced(self._site, report=longest, announcements=of.announcements, hops=min(of.hops, HOPS))

    @property
    def passing(self) -> Passing:
        """For what is predicted of a run."""
        of, pace = self.of, self.pace
        return Passing(
            self.groups,
            {group[0]: self._tells(group) for group in self.groups},
            of.heads != "fixed",
            of.hops,
            of.interest_s,
            of.base,
            pace.hop_ns,
            pace.close_ns,
            pace.gather_ns,
            pace.turn_ns,
            of.announcements,
            pace.setup.announce_ns,
        )

    @property
    def _site(self) -> Site:
        return self.field.site

    @cached_property
    def _places(self) -> dict[str, tuple[float, float]]:
        return {id: (x, y) for id, x, y in self._site.sensors}

    @cached_property
    def _reports(self) -> tuple[str, ...]:
        return tuple(sorted({kind_of_class(one.sensing.message).name for one in self._site.sections.values()}))

    @cached_property
    def _range_m(self) -> float:
        return max(section.sensing.range_m for section in self._site.sections.values())

    def _announcing(self, number: int, x: float, y: float) -> dict[str, Any]:
        """The arguments of the ``Announcing`` of a node; the base comes after all of them."""
        nodes, announce_ns = len(self.field.sensors), self.pace.setup.announce_ns
        turns = {"number": number, "nodes": nodes, "announcements": self.of.announcements, "announce_ns": announce_ns}
        return {**turns, "x_m": x, "y_m": y}

    @property
    def _diffusion(self) -> dict[str, Any]:
        """The arguments of the ``Diffusion`` of a process besides the id and the place."""
        seed = self.field.scenario.seed
        return {"seed": seed, "patience_ns": self.pace.patience_ns, "hop_ns": self.pace.jitter_ns}

    @property
    def _heard(self) -> dict[str, tuple[str, ...]]:
        """What a node says to all in reach."""
        kinds = SENT if self.of.heads == "fixed" else (*self._reports, *SENT, "fix")
        return dict.fromkeys(kinds, (NEIGHBOURHOOD,))

    # --- the base ------------------------------------------------------------------------------------------------

    def sink(self) -> Process:
        """The base, which is told of fixes."""
        x, y = self.field.centre
        ids, of = [id for id, *_ in self.field.sensors], self.of
        return Process(
            of.base,
            SINK,
            x,
            y,
            config={
                **{"id": of.base, "x_m": x, "y_m": y, "deadline_ns": round(BEFORE_NEXT * self._site.step_ns)},
                "association": self.pace.setup.association(len(ids), of.announcements),
                "diffusion": self._diffusion,
                "interest": {"interest_s": of.interest_s, "most_hops": MOST_HOPS},
                **spline_of(self._site),
            },
            sends=dict.fromkeys(SENT, (NEIGHBOURHOOD,)),
            hears=SENT,
            fuses=ids,
            tags=(TRACKS,),
            route=self.field.route,
            draws=of.base,
        )

    # --- a node --------------------------------------------------------------------------------------------------

    def ear(self, number: int) -> Process:
        """The node with the sensor of this number."""
        id, x, y = self.field.sensors[number]
        group = next((group for group in self.groups if id in group), ())
        settings, known = self._settings(id, group)
        fusion = self.field.scenario.fusion
        head = {
            **{"settings": settings, "times": dict(self.pace.times), "deadline_ns": round(fusion.deadline_s * NS)},
            **if_used(max_age_ns=round(fusion.max_age_s * NS)),
        }
        return Process(
            id,
            EAR,
            x,
            y,
            roles={
                "ear": Hosted(config=self._ear(number), clock="keeps"),
                "hearing": Hosted(config=head, fuses=True, clock="follows"),
            },
            sends=self._heard,
            hears=tuple(self._heard),
            senses=True,
            fuses=known,
            asks=self.of.base,
            tags=(BATTERY, TRACKS),
            battery_j=self.field.scenario.energy.battery_j,
            draws=self.of.base,
        )

    def _ear(self, number: int) -> dict[str, Any]:
        """The arguments of the half that senses."""
        (id, x, y), (bx, by), setup = self.field.sensors[number], self.field.centre, self.pace.setup
        return {
            "id": id,
            "step_ns": self._site.step_ns,
            "origin_ns": self._site.origin_ns,
            "announcing": self._announcing(number, x, y),
            "keeping": {
                **{"base": self.of.base, "base_x_m": bx, "base_y_m": by, "away_m": hypot(x - bx, y - by)},
                **{"start_ns": setup.announce_ns, "spread_ns": setup.spread_ns, "settled_ns": self._site.origin_ns},
            },
            "diffusion": self._diffusion,
            **if_used(broadcasts=self.of.heads != "fixed"),
        }

    def _settings(self, id: str, group: Group) -> tuple[dict[str, Any], list[str]]:
        """The settings of the half that may lead, and the sensors whose reports it may get."""
        radius_m = self._radius_m(group) if group else 2.0 * self._range_m
        middle = _centre([self._places[one] for one in group]) if group else self._places[id]
        error_m = 3.0 * max(section.position_error_m for section in self._site.sections.values())
        radius_m += error_m + MARGIN_M
        known = [one for one, place in self._places.items() if dist(place, middle) <= radius_m]
        numbers = {one: number for number, (one, *_) in enumerate(self.field.sensors)}
        settings = {
            **{"id": id, "numbers": numbers, "heads": self.of.heads, "reports": self.of.reports},
            **{"group": list(group), "radius_m": radius_m, "interest_s": self.of.interest_s},
            **{"most_hops": self.of.hops, "hand_m": self._hand_m(group), "comes_m": self._range_m},
        }
        return settings, known

    def _radius_m(self, group: Group) -> float:
        """How far the farthest sensor of a cluster is from its centre (m)."""
        places = [self._places[id] for id in group]
        return max(dist(place, _centre(places)) for place in places)

    def _tells(self, group: Group) -> tuple[str, ...]:
        """The heads that want the fixes of the head of this cluster."""
        place, others = self._places[group[0]], self._others(group)
        middles = {other[0]: _centre([self._places[id] for id in other]) for other in others}
        return tuple(other[0] for other in others if dist(place, middles[other[0]]) <= self._hand_m(other))

    def _hand_m(self, group: Group) -> float:
        """How far those are (m) whose fixes a head wants, as the target may come on from them; 0: there are none."""
        if not group or len(self.groups) < 2:
            return 0.0
        middle, *others = (_centre([self._places[id] for id in one]) for one in (group, *self._others(group)))
        return NEXT * min(dist(middle, other) for other in others)

    def _others(self, group: Group) -> list[Group]:
        return [one for one in self.groups if one != group]


def _centre(places: Sequence[tuple[float, float]]) -> tuple[float, float]:
    xs, ys = zip(*places, strict=True)
    return sum(xs) / len(places), sum(ys) / len(places)


def _check(field: Field) -> None:
    """Raise ``ScenarioError`` for sensors that do not report closest points of approach."""
    kind = field.scenario.architecture.kind
    for name, section in field.site.sections.items():
        sensing, key = section.sensing, "sensor" if len(field.site.sections) == 1 else f"sensors '{name}'"
        if sensing.recorded:
            what = f"is played, and with architecture {kind} heads solve for passes, of which a recording has none"
            raise ScenarioError(what, key=f"{key}.recording", expected="no recording, or architecture 'centralised'")
        if sensing.message not in (CpaReport, CpaReportSds):
            own = kind_of_class(sensing.message).name
            what = (
                f"is {name!r}, which reports in messages {own!r}, and with architecture {kind} heads solve for passes"
            )
            expected = "sensors that hear targets pass (kind 'cpa'), or another architecture"
            raise ScenarioError(what, key=f"{key}.kind", expected=expected)
