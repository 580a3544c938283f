"""Small fields of masters and slaves, as roles alone (``tests/ether.py``)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import inf
from typing import Any, Final

from fusion.base import Base
from head.master import Master
from node.slave import Slave
from tests.ether import DELAY_NS, ORIGIN_NS, Net, Place, Target
from tests.puppet import MS
from trackfield.filters.metrics import LOST_M
from trackfield.role import NS

SLOT_NS: Final = 25 * MS
DEADLINE_NS: Final = 400 * MS
BEACON_NS: Final = 970 * MS
HANDOVER_NS: Final = 125 * MS
ANNOUNCE_NS: Final = 2 * NS
TURN_NS: Final = 100 * MS
TIMES: Final = {
    "slot_ns": SLOT_NS, "slots": 12, "gather_slots": 1, "beacon_ns": BEACON_NS, "preamble_ns": 0,
    "handover_ns": HANDOVER_NS, "frame_ns": DELAY_NS, "late_ns": 0, "clock_ns": 0,
}  # fmt: skip
ASSOCIATION: Final = {
    "announcements": 5, "announce_ns": ANNOUNCE_NS, "answers_ns": 500 * MS, "setup_ns": 10 * NS, "keep_ns": 750 * NS,
}  # fmt: skip
JOINING: Final = {
    "announce_ns": ANNOUNCE_NS, "turn_ns": TURN_NS, "patience_ns": 70 * MS, "answers_ns": 570 * MS,
    "again_ns": 10 * NS, "renew_ns": 300 * NS,
}  # fmt: skip
WAKEUP: Final = {"every_ns": NS, "open_ns": 15 * MS, "from_ns": ORIGIN_NS + 985 * MS}

PRIOR_SD: Final = [1.0, 1.0, 0.5, 0.5]
BASE: Final = "base"
EAST: Final[Sequence[Place]] = ((0.0, 0.0), (200.0, 0.0), (400.0, 0.0))
"""Three masters in a row."""


def around(masters: Sequence[Place], each: int = 4) -> list[Place]:
    """So many slaves around each master, up to 36 m away."""
    off = ((-30.0, 20.0), (30.0, 20.0), (-30.0, -20.0), (20.0, -30.0), (0.0, 25.0), (5.0, -15.0))
    return [(x + dx, y + dy) for x, y in masters for dx, dy in off[:each]]


def eastward(x_m: float = 20.0, speed: float = 5.0, y_m: float = 5.0) -> Target:
    """A target that moves on a line past the masters."""
    return lambda t_s: (x_m + speed * t_s, y_m)


def named(masters: Sequence[Place]) -> list[tuple[str, float, float]]:
    return [(f"m{i}", x, y) for i, (x, y) in enumerate(masters)]


def master_of(
    number: int,
    masters: Sequence[Place],
    slaves: Sequence[Place],
    *,
    prior: Sequence[float] | None = None,
    capacity: int = 5,
    unasked: bool = False,
    sync: Mapping[str, Any] | None = None,
    association: Mapping[str, int] | None = None,
    lost_m: float = LOST_M,
    **settings: Any,
) -> Master:
    """The master of this number; ``settings`` are fields of its ``Settings``."""
    chosen = {"id": f"m{number}", "base": BASE, "base_x_m": 0.0, "base_y_m": 50.0, "masters": named(masters)}
    return Master(
        settings={**chosen, "policy": "closest", **settings},
        times=TIMES,
        association={
            **ASSOCIATION,
            "capacity": capacity,
            "share": (number + 1) / (len(masters) + 1),
            **(association or {}),
        },
        deadline_ns=DEADLINE_NS,
        unasked=unasked,
        sync=sync,
        **{**bank_of(slaves, prior), "lost_m": lost_m},
    )


def slave_of(
    number: int,
    place: Place,
    *,
    unasked: bool = False,
    sync: Mapping[str, Any] | None = None,
    threshold_db: float = -inf,
    **joining: Any,
) -> Slave:
    """The slave of this number."""
    x, y = place
    who = {"id": f"s{number:02}", "sensor": number, "x_m": x, "y_m": y, "seed": 1}
    return Slave(
        step_ns=NS,
        slot_ns=SLOT_NS,
        origin_ns=ORIGIN_NS,
        joining={**JOINING, **who, **joining},
        wakeup=WAKEUP,
        unasked=unasked,
        sync=sync,
        threshold_db=threshold_db,
    )


def bank_of(slaves: Sequence[Place], prior: Sequence[float] | None) -> dict[str, Any]:
    """The arguments of a ``Bank`` with an UKF of ranges."""
    options = {"range_m": 1e4, "floor_sd_m": 0.5, "growth_m": 0.0}
    return {
        "trackers": ["ukf"],
        "sensors": [(f"s{i:02}", x, y) for i, (x, y) in enumerate(slaves)],
        "step_ns": NS,
        "origin_ns": ORIGIN_NS,
        "seed": 1,
        "sensing": {"range": {"kind": "range", "options": options}},
        "sigma_v": 0.3,
        "prior": None if prior is None else {"mean": list(prior), "sd": PRIOR_SD},
    }


def field_of(
    masters: Sequence[Place] = EAST,
    slaves: Sequence[Place] | None = None,
    *,
    target: Target | None = None,
    prior: bool = True,
    range_m: float = 1e4,
    beacon_every: int = 10,
    unasked: bool = False,
    joining: Mapping[str, Any] | None = None,
    association: Mapping[str, int] | None = None,
    before: Callable[[Net], object] = lambda _: None,
    **masters_too: Any,
) -> Net:
    """A field that has started, with a base; ``before`` that a test may say what befalls it from the start on."""
    slaves, target = around(masters) if slaves is None else slaves, eastward() if target is None else target
    start, then = target(0.0), target(1.0)
    known = [*start, then[0] - start[0], then[1] - start[1]] if prior and start and then else None
    net = Net(target, range_m)
    given = {
        "prior": known,
        "beacon_every": beacon_every,
        "unasked": unasked,
        "association": association,
        **masters_too,
    }
    base: dict[str, Any] = {
        "id": BASE,
        "x_m": 0.0,
        "y_m": 50.0,
        "association": {**ASSOCIATION, "capacity": 0, "share": 0.0},
    }
    net.add(BASE, Base(**base, deadline_ns=DEADLINE_NS, **bank_of(slaves, known)), (0.0, 50.0))
    for number, place in enumerate(masters):
        net.add(f"m{number}", master_of(number, masters, slaves, **given), place)
    for number, place in enumerate(slaves):
        net.add(f"s{number:02}", slave_of(number, place, unasked=unasked, **(joining or {})), place)
    before(net)
    for id in list(net.actors):
        net.start(id)
    return net
