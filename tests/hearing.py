"""Small fields that hear targets pass, as roles alone (``tests/ether.py``): ears with heads' halves, and a base."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import cos, hypot, log10, pi, radians, sin
from typing import Any, Final

from fusion.sink import Sink
from head.hearing.memory import Leadership
from head.hearing.memory import Memory as HeadMemory
from head.hearing.role import Hearing
from head.hearing.settings import Heads
from node.ear import Ear
from node.ear import Memory as EarMemory
from tests.ether import ORIGIN_NS, Net, Place
from tests.puppet import MS
from trackfield.host import Host
from trackfield.role import NS, TrackPoint
from trackfield.sensing.cpa import Passed

STEP_NS: Final = NS // 2
DEADLINE_NS: Final = 300 * MS
SOUND_M_S: Final = 340.0
KNOWN_NS: Final = NS
RADIUS_M: Final = 20.0
REACH_M: Final = 30.0
"""Nodes that are neighbours on a pentagon hear each other, and those on a diagonal do not."""
BASE: Final = "base"
INTEREST_S: Final = 9.0
CLOSE_NS: Final = 1500 * MS
GATHER_NS: Final = 1500 * MS
TURN_NS: Final = 500 * MS
MAX_AGE_NS: Final = 6 * NS
ANNOUNCE_NS: Final = 6 * NS
JITTER: Final = ((0.05, -0.08), (0.10, 0.05), (-0.08, 0.10), (0.06, -0.05), (-0.10, 0.02))
"""Of the corners of a pentagon, in radii (spec, deployment)."""
OPTIONS: Final = {"range_m": 60.0, "time_sd_s": 0.01, "strength_sd": 0.05}


@dataclass(frozen=True)
class Line:
    """A target that is nearest to (``x_m``, ``y_m``) ``at_s`` after step 0, moves at ``speed`` to the bearing.

    Reports of it say the ``sds`` of time (s) and strength (dB), if there are any.
    """

    x_m: float
    y_m: float
    bearing_deg: float
    at_s: float
    speed: float = 13.4
    heard_m: float = 60.0
    sds: tuple[float, ...] = ()

    @property
    def velocity(self) -> tuple[float, float]:
        bearing = radians(self.bearing_deg)
        return self.speed * sin(bearing), self.speed * cos(bearing)

    def at(self, t_s: float) -> tuple[float, float, float, float]:
        vx, vy = self.velocity
        return self.x_m + vx * (t_s - self.at_s), self.y_m + vy * (t_s - self.at_s), vx, vy

    def passes(self, place: Place) -> tuple[int, Passed] | None:
        """When (ns, true) a node hears it pass, and what it then reads, without noise."""
        vx, vy = self.velocity
        dx, dy = place[0] - self.x_m, place[1] - self.y_m
        after_s, away_m = (dx * vx + dy * vy) / self.speed**2, abs(dx * vy - dy * vx) / self.speed
        if away_m > self.heard_m:
            return None
        at_ns = ORIGIN_NS + round((self.at_s + after_s + away_m / SOUND_M_S) * NS)
        read = (-KNOWN_NS / NS, -20.0 * log10(max(away_m, 1.0)), min(away_m / self.speed, 6.3))
        return at_ns, Passed((*read, *self.sds))


def pentagon(x_m: float = 0.0, y_m: float = 0.0) -> list[Place]:
    """The nodes of a cluster, displaced as in `yang-ecpa`."""
    angles = [pi / 2 + 2 * pi * corner / 5 for corner in range(5)]
    corners = zip(angles, JITTER, strict=True)
    return [(x_m + RADIUS_M * (cos(a) + jx), y_m + RADIUS_M * (sin(a) + jy)) for a, (jx, jy) in corners]


def named(places: Sequence[Place]) -> dict[str, Place]:
    return {f"n{number:02}": place for number, place in enumerate(places)}


class Field(Net):
    """A puppet network of such nodes; frames come as far as ``reach_m``."""

    def __init__(self, lines: Sequence[Line], reach_m: float) -> None:
        super().__init__()
        self.lines, self.extra = list(lines), dict[str, list[tuple[int, Passed]]]()
        self.reaches = lambda src, dst: self.apart_m(src, dst) <= reach_m

    def apart_m(self, a: str, b: str) -> float:
        (ax, ay), (bx, by) = self.actors[a].place, self.actors[b].place
        return hypot(ax - bx, ay - by)

    def cut(self, *ids: str) -> None:
        """From now on nobody hears these, and they hear nobody."""
        before = self.reaches
        self.reaches = lambda src, dst: not {src, dst} & set(ids) and before(src, dst)

    def until(self, seconds: float) -> Field:
        """Up to so long after step 0."""
        self.run(ORIGIN_NS + round(seconds * NS))
        return self

    # --- the sensors ---

    def known(self, id: str) -> list[tuple[int, Passed]]:
        """When the sensor knows of a pass, and what it reads then."""
        found = [one for line in self.lines if (one := line.passes(self.actors[id].place)) is not None]
        return sorted([(at_ns + KNOWN_NS, read) for at_ns, read in found] + self.extra.get(id, []), key=lambda p: p[0])

    def reading(self, id: str, t_ns: int | None = None) -> Any:
        now = self.t_ns if t_ns is None else t_ns
        return next((read for at_ns, read in self.known(id) if at_ns == now), None)

    def _wakes(self, id: str) -> int | None:
        later = (at_ns for at_ns, _ in self.known(id) if at_ns > self.t_ns)
        found = next(later, None)
        return None if found is None else found + self.actors[id].ahead_ns

    # --- what a test asks ---

    @property
    def nodes(self) -> list[str]:
        return [id for id in self.actors if id != BASE]

    def ear(self, id: str) -> EarMemory:
        state: EarMemory = self.state(id).states["ear"]
        return state

    def head(self, id: str) -> HeadMemory:
        state: HeadMemory = self.state(id).states["hearing"]
        return state

    def leads(self, id: str) -> Leadership:
        found = self.head(id).leads
        assert found is not None
        return found

    def leaders(self) -> list[str]:
        return [id for id in self.nodes if self.actors[id].alive and self.head(id).leads is not None]

    def said(self, text: str) -> list[str]:
        return [note for *_, note in self.notes if text in note]

    def events(self, by: str) -> list[TrackPoint]:
        """The points of a process in which an event ended."""
        return [point for _, id, point in self.points if id == by and point.event_ns is not None]

    def last(self, by: str = BASE) -> TrackPoint:
        """The last point of a process."""
        return [point for _, id, point in self.points if id == by][-1]

    def error(self, line: Line, by: str = BASE) -> tuple[float, float]:
        """How far the last point of a track is from the target (m), and how wrong its velocity is (m/s)."""
        point = next((point for _, id, point in reversed(self.points) if id == by and point.mean), None)
        if point is None:
            return float("inf"), float("inf")
        x, y, vx, vy = line.at((point.at_ns - ORIGIN_NS) / NS)
        return hypot(point.mean[0] - x, point.mean[1] - y), hypot(point.mean[2] - vx, point.mean[3] - vy)


def bank_of(
    places: Mapping[str, Place], trackers: Sequence[str] = ("ml",), prior: Any = None, *, variances: bool = False
) -> dict[str, Any]:
    return {
        "prior": prior,
        "trackers": list(trackers),
        "sensors": [(id, x, y) for id, (x, y) in places.items()],
        "step_ns": STEP_NS,
        "origin_ns": ORIGIN_NS,
        "seed": 1,
        "sensing": {"cpa": {"kind": "cpa", "options": {**OPTIONS, "variances": variances}}},
        "sigma_v": 0.1,
    }


DIFFUSION: Final = {"seed": 1, "patience_ns": 50 * MS}


def ear_of(id: str, places: Mapping[str, Place], *, broadcasts: bool = False, sync: Any = None) -> Ear:
    (x, y), number = places[id], list(places).index(id)
    return Ear(
        id=id,
        step_ns=STEP_NS,
        origin_ns=ORIGIN_NS,
        announcing={
            **{"number": number, "nodes": len(places), "announcements": 3, "announce_ns": ANNOUNCE_NS},
            **{"x_m": x, "y_m": y},
        },
        keeping={
            **{"base": BASE, "base_x_m": 0.0, "base_y_m": -45.0, "away_m": hypot(x, y + 45.0)},
            **{"start_ns": ANNOUNCE_NS, "spread_ns": 3 * NS, "settled_ns": ORIGIN_NS},
        },
        diffusion=DIFFUSION,
        broadcasts=broadcasts,
        sync=sync,
    )


def hearing_of(
    id: str,
    places: Mapping[str, Place],
    heads: Heads,
    group: Sequence[str],
    *,
    trackers: Sequence[str] = ("ml",),
    prior: Any = None,
    sync: Any = None,
    variances: bool = False,
    **settings: Any,
) -> Hearing:
    around = {one: places[one] for one in group} if heads == "fixed" else places
    return Hearing(
        settings={
            **{"id": id, "numbers": {one: i for i, one in enumerate(places)}, "heads": heads, "group": list(group)},
            **{"interest_s": INTEREST_S if heads == "fixed" else 5.0, "radius_m": 45.0, "comes_m": 45.0},
            **{"most_hops": 4 if heads == "fixed" else 2},
            **settings,
        },
        times={"close_ns": CLOSE_NS, "gather_ns": GATHER_NS, "turn_ns": TURN_NS},
        deadline_ns=DEADLINE_NS,
        max_age_ns=MAX_AGE_NS,
        sync=sync,
        **bank_of(around, trackers, prior, variances=variances),
    )


def sink_of(places: Mapping[str, Place], place: Place, trackers: Sequence[str] = ("ml",), spline: Any = None) -> Sink:
    return Sink(
        spline=spline is not None,
        **(spline or {}),
        id=BASE,
        x_m=place[0],
        y_m=place[1],
        deadline_ns=450 * MS,
        association={
            **{"announcements": 3, "announce_ns": ANNOUNCE_NS, "setup_ns": ANNOUNCE_NS, "capacity": 0},
            **{"answers_ns": NS, "keep_ns": NS, "share": 0.9},
        },
        diffusion=DIFFUSION,
        interest={"interest_s": INTEREST_S, "most_hops": 16},
        **bank_of(places, trackers),
    )


def field_of(
    *lines: Line,
    places: Sequence[Place] | None = None,
    heads: Heads = "fixed",
    size: int = 5,
    reach_m: float = REACH_M,
    base: Place = (0.0, -40.0),
    trackers: Sequence[str] = ("ml",),
    sync: Mapping[str, Any] | None = None,
    ahead_ns: Mapping[str, int] | None = None,
    before: Callable[[Field], object] = lambda _: None,
    spline: Mapping[str, int] | None = None,
    **settings: Any,
) -> Field:
    """A field that has started, with a base; ``before`` that a test may say what befalls it from the start on."""
    known = named(pentagon() if places is None else places)
    settings["variances"] = any(line.sds for line in lines)
    ids, field = list(known), Field(lines, reach_m)
    field.add(BASE, sink_of(known, base, trackers, spline), base)
    for number, id in enumerate(ids):
        group = ids[number // size * size :][:size]
        keeps = None if sync is None else {**sync, "id": id}
        follows = None if sync is None else {"follows_ns": 2 * NS}
        roles: dict[str, Any] = {
            "ear": ear_of(id, known, broadcasts=heads == "loudest", sync=keeps),
            "hearing": hearing_of(id, known, heads, group, trackers=trackers, sync=follows, **settings),
        }
        field.add(id, Host(roles, id=id), known[id], (ahead_ns or {}).get(id, 0))
    before(field)
    for id in list(field.actors):
        field.start(id)
    return field
