"""What the processes of a camera might tell, by hand: a camera in the south, and a target that goes east at 10 m/s."""

from __future__ import annotations

from typing import Any

from launcher.outside import Aim, Counts, Exposure, Known, Ordered, Outside, Refusal, Turn
from trackfield.models.pointing import Mount, towards
from trackfield.role import NS
from trackfield.world.path import Path

MOUNT = Mount(0.0, -30.0, 0.75, 90.0)
"""It looks north at pan 0, from the height at which it looks at vehicles: tilt is 0."""
PATH = Path.of([(0.0, -100.0, 0.0, 10.0, 0.0), (20.0, 100.0, 0.0, 10.0, 0.0)])
"""At 10 s the target is north of the camera, 30 m away."""
ONE = {"target": PATH}
END_NS = 20 * NS


def ns(t_s: float) -> int:
    """Seconds in ns."""
    return round(t_s * NS)


def still(t_s: float = 0.0, pan: float = 0.0, tilt: float = 0.0) -> Turn:
    """The camera rests, and looks there."""
    return Turn(ns(t_s), pan, tilt, pan, tilt, 80.0, 50.0)


def turn(t_s: float, pan0: float, pan1: float) -> Turn:
    """The camera turns at 80 degrees a second."""
    return Turn(ns(t_s), pan0, 0.0, pan1, 0.0, 80.0, 50.0)


def aim(t_s: float, at_s: float, x_m: float, y_m: float = 0.0, **more: Any) -> Aim:
    """A shot that is commanded at ``t_s``, for when the target is at this place."""
    to = towards(MOUNT, x_m, y_m)
    found = {"shot": 1, "head": "n000", "step": 3, "delay_s": 1.25, "cpa_ns": ns(t_s - 1.25), "outcome": "aimed"} | more
    return Aim(
        ns(t_s), found["shot"], found["head"], found["step"], found["delay_s"], found["cpa_ns"], ns(at_s), x_m, y_m,
        found.get("pan", to.pan), found.get("tilt", to.tilt), found["outcome"],
    )  # fmt: skip


def everything() -> Outside:
    """A row or more of each kind."""
    return Outside(
        MOUNT,
        (still(), turn(9.0, 0.0, 45.0)),
        (aim(8.9, 13.0, 30.0), aim(9.5, 13.0, 30.0, shot=0, outcome="superseded")),
        tuple(Exposure(ns(9.0 + number / 2), 1, number) for number in range(6)),
        (Counts(ns(8.0), 0, 1, 0, 0, 0, 0), Counts(ns(8.5), 0, 0, 1, 0, 0, 0)),
        (Known(ns(1.0), "ready"), Known(ns(9.0), "moving"), Known(ns(9.6), "there")),
        (Ordered(ns(3.0), 1, "status", "video", "ok"),),
        (Refusal(ns(4.0), "video", "stranger", "mac"),),
    )
