"""Small fields in which any node may lead, as roles alone (``tests/ether.py``): each a member and a header."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import hypot, inf, log10
from typing import Any, Final, Literal

from fusion.base import Base
from head.header import Header
from head.peers.memory import Leadership
from head.peers.memory import Memory as HeaderMemory
from node.member import Member
from node.member import Memory as MemberMemory
from tests.ether import DELAY_NS, ORIGIN_NS, Net, Place, Target
from tests.puppet import MS
from trackfield.host import Host
from trackfield.protocols.election import settling_ns
from trackfield.role import NS

Manner = Literal["location-central", "elected"]
MANNERS: Final[tuple[Manner, ...]] = ("location-central", "elected")

SLOT_NS: Final = 25 * MS
DEADLINE_NS: Final = 200 * MS
BEACON_NS: Final = 970 * MS
HANDOVER_NS: Final = 300 * MS
WORD_NS: Final = 500 * MS
TURN_NS: Final = 50 * MS
ANNOUNCE_NS: Final = 6 * NS
LEASE_NS: Final = 2 * NS + 250 * MS
HOP_NS: Final = 4 * DELAY_NS
ELECTION: Final = {"hop_ns": HOP_NS, "settle_ns": settling_ns(DELAY_NS, hop_ns=HOP_NS, jitter_ns=10 * MS)}
TIMES: Final = {
    "beacon_ns": BEACON_NS, "preamble_ns": 0, "handover_ns": HANDOVER_NS, "word_ns": WORD_NS, "turn_ns": TURN_NS,
    "slot_ns": SLOT_NS, "lease_ns": LEASE_NS, "announce_ns": ANNOUNCE_NS,
}  # fmt: skip
ANNOUNCEMENTS: Final = 3
WAKEUP: Final = {"every_ns": NS, "open_ns": 15 * MS, "from_ns": ORIGIN_NS + 985 * MS}
FOLLOWS: Final = {"follows_ns": 2 * NS}
"""How a header uses the clock that its member sets."""

BASE: Final = "base"
BASE_PLACE: Final = (0.0, -50.0)
RANGE_M: Final = 50.0
"""So far a sensor senses the target."""
WITHIN_M: Final = 25.0
"""An elected head leads on while the target is so near to it."""
APART_M: Final = 30.0


def grid(columns: int = 8, rows: int = 2) -> list[Place]:
    """Nodes in columns from west to east: n00 and n01 are the first one, n02 and n03 the next."""
    return [(APART_M * column, APART_M * row) for column in range(columns) for row in range(rows)]


def named(places: Sequence[Place]) -> dict[str, Place]:
    return {f"n{number:02}": place for number, place in enumerate(places)}


def eastward(x_m: float = 8.0, speed: float = 5.0, y_m: float = 11.0, until: float = inf) -> Target:
    """A target that moves past the nodes, ``until`` so many seconds after step 0."""
    return lambda t_s: (x_m + speed * t_s, y_m) if t_s < until else None


class Field(Net):
    """A puppet network of hosts; frames come as far as ``reach_m``, but those of the base and to it come anywhere."""

    def __init__(self, target: Target, reach_m: float) -> None:
        super().__init__(target, RANGE_M)
        self.reaches = lambda src, dst: BASE in (src, dst) or self.apart_m(src, dst) <= reach_m

    def apart_m(self, a: str, b: str) -> float:
        (ax, ay), (bx, by) = self.actors[a].place, self.actors[b].place
        return hypot(ax - bx, ay - by)

    def cut(self, *groups: Sequence[str]) -> None:
        """From now on nodes of different groups do not hear each other; those of none hear all."""
        group = {id: i for i, ids in enumerate(groups) for id in ids}
        before = self.reaches
        self.reaches = lambda src, dst: before(src, dst) and len({group[i] for i in (src, dst) if i in group}) < 2

    @property
    def nodes(self) -> list[str]:
        return [id for id in self.actors if id != BASE]

    def header(self, id: str) -> HeaderMemory:
        state: HeaderMemory = self.state(id).states["header"]
        return state

    def member(self, id: str) -> MemberMemory:
        state: MemberMemory = self.state(id).states["member"]
        return state

    def leads(self, id: str) -> Leadership:
        found = self.header(id).leads
        assert found is not None
        return found

    def leaders(self) -> list[str]:
        """Those that live and lead, frozen ones too."""
        return [id for id in self.nodes if self.actors[id].alive and self.header(id).leads is not None]

    def begun(self) -> list[tuple[str, int, str]]:
        """Who began to lead, in which term, and why."""
        said = [text for *_, text in self.notes if " leads in term " in text]
        return [(text.split()[0], int(text.split()[4].rstrip(":")), text.split(": ", 1)[1]) for text in said]

    def began_ns(self) -> list[int]:
        """When they did so, after step 0."""
        return [t - ORIGIN_NS for t, _, text in self.notes if " leads in term " in text]

    def used(self, step: int) -> tuple[str, ...]:
        """Whose reports the track of a step is from."""
        point = self.track(step)
        return () if point is None else tuple(sorted(point.sensors))

    def follows_well(self, first: int, last: int, within_m: float = 1.0) -> bool:
        return all(self.error_m(step) < within_m for step in range(first, last + 1))

    def until_led(self, by_step: int = 8) -> Field:
        """Up to the end of the first step at which one node leads, and all in the field know it."""
        while self.step < by_step and not (self.leaders() and self.track(self.step)):
            self.to_step(self.step + 1)
        return self


def bank_of(places: Sequence[Place], prior: Sequence[float] | None = None) -> dict[str, Any]:
    """The arguments of a ``Bank`` with an UKF of ranges."""
    options = {"range_m": RANGE_M, "floor_sd_m": 0.5, "growth_m": 0.0}
    return {
        "trackers": ["ukf"],
        "sensors": [(id, x, y) for id, (x, y) in named(places).items()],
        "step_ns": NS,
        "origin_ns": ORIGIN_NS,
        "seed": 1,
        "sensing": {"range": {"kind": "range", "options": options}},
        "sigma_v": 0.3,
        "prior": None if prior is None else {"mean": list(prior), "sd": [1.0, 1.0, 0.5, 0.5]},
    }


MANNER: Final[Mapping[Manner, Mapping[str, Any]]] = {
    "location-central": {"count": 4, "search": 8, "takes_over": True, "short": True},
    "elected": {"count": 3, "search": 6, "joins": True, "keep_within_m": WITHIN_M, "takes_over": False, "short": False},
}


def header_of(
    number: int,
    places: Sequence[Place],
    manner: Manner,
    *,
    prior: Sequence[float] | None = None,
    sync: Mapping[str, Any] | None = None,
    times: Mapping[str, int] | None = None,
    **settings: Any,
) -> Header:
    """The header of this number; ``settings`` are fields of its ``Settings``."""
    known = {
        "id": f"n{number:02}",
        "number": number,
        "numbers": {id: i for i, id in enumerate(named(places))},
        "quiet_db": -20.0 * log10(RANGE_M),
        "loud_db": -20.0 * log10(0.05 * RANGE_M),
        "announcements": ANNOUNCEMENTS,
    }
    return Header(
        settings={**known, **MANNER[manner], **settings},
        times={**TIMES, "nodes": len(places), **(times or {})},
        election=ELECTION,
        deadline_ns=DEADLINE_NS,
        sync=sync,
        **bank_of(places, prior),
    )


def member_of(
    number: int,
    place: Place,
    *,
    sync: Mapping[str, Any] | None = None,
    threshold_db: float = -inf,
    always_on: bool = False,
    local: bool = False,
) -> Member:
    """The member of this number."""
    x, y = BASE_PLACE
    return Member(
        keeping={
            **{"base": BASE, "base_x_m": x, "base_y_m": y, "away_m": hypot(place[0] - x, place[1] - y)},
            **{"start_ns": ANNOUNCE_NS, "spread_ns": 5 * NS, "settled_ns": ORIGIN_NS},
        },
        local=local,
        id=f"n{number:02}",
        number=number,
        step_ns=NS,
        slot_ns=SLOT_NS,
        wakeup=None if always_on else WAKEUP,
        origin_ns=ORIGIN_NS,
        threshold_db=threshold_db,
        sync=sync,
    )


def field_of(
    manner: Manner,
    places: Sequence[Place] | None = None,
    *,
    target: Target | None = None,
    reach_m: float = inf,
    prior: bool = False,
    sync: Mapping[str, Any] | None = None,
    ahead_ns: Mapping[str, int] | None = None,
    before: Callable[[Field], object] = lambda _: None,
    **settings: Any,
) -> Field:
    """A field that has started, with a base; ``before`` that a test may say what befalls it from the start on."""
    places, target = grid() if places is None else places, eastward() if target is None else target
    start, then = target(0.0), target(1.0)
    known = [*start, then[0] - start[0], then[1] - start[1]] if prior and start and then else None
    field = Field(target, reach_m)
    field.add(BASE, Base(deadline_ns=950 * MS, **bank_of(places)), BASE_PLACE)
    for number, (id, place) in enumerate(named(places).items()):
        keeps = None if sync is None else {**sync, "id": id}
        roles: dict[str, Any] = {
            "member": member_of(
                number,
                place,
                sync=keeps,
                always_on=bool(settings.get("always_on")),
                local=bool(settings.get("local")),
            ),
            "header": header_of(number, places, manner, prior=known, sync=keeps and FOLLOWS, **settings),
        }
        field.add(id, Host(roles, id=id), place, (ahead_ns or {}).get(id, 0))
    before(field)
    for id in list(field.actors):
        field.start(id)
    return field
