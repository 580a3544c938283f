"""What is expected of the camera beyond a field that hears targets pass."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Final

from launcher.plan.forecast.backbone import Backbone
from launcher.plan.forecast.hearing.passed import Fixed, Passed
from trackfield.models.pointing import AHEAD, EVI_D30, Mount, intercept
from trackfield.role import NS

NAMED: Final = 3
"""So many fixes are named."""


@dataclass(frozen=True)
class Watched:
    """What becomes of the fixes of a ``field`` beyond its gateway."""

    field: Passed
    backbone: Backbone

    @classmethod
    def of(cls, field: Passed) -> Watched | None:
        """Of such a field; None if it has no camera."""
        backbone = Backbone.of(field.plan)
        return None if backbone is None else cls(field, backbone)

    @property
    def mount(self) -> Mount:
        """Where the camera stands."""
        return Mount(**self.backbone.control.config["mount"])

    @cached_property
    def told(self) -> tuple[Fixed, ...]:
        """The fixes of which the base is told."""
        return tuple(fixed for fixed in self.field.fixes if fixed.base_ns is not None)

    @cached_property
    def missed(self) -> tuple[Fixed, ...]:
        """Those of them whose target the camera cannot be turned to any more, if that goes on as it does then."""
        return tuple(fixed for fixed in self.told if not self._meets(fixed))

    def _meets(self, fixed: Fixed) -> bool:
        """Whether the camera, turned from its middle, meets the target of this fix, which goes on as it does then."""
        at_s = (fixed.base_ns or 0) / NS + self.backbone.after_s
        state = self.field.plan.paths[fixed.event.target].at(at_s)
        if state is None:
            return False
        x, y, vx, vy = (float(one) for one in state)
        return intercept(self.mount, AHEAD, (x, y, vx, vy), 0.0) is not None

    def words(self) -> Iterator[str]:
        """A line on it."""
        hops = len(self.backbone.way)
        ways = "directly" if hops == 1 else f"over {hops} hops"
        yield (
            f"camera: its control is told of a fix {_time(self.backbone.after_s)} after the base, {ways}; "
            f"then it can be turned to the target of {len(self.told) - len(self.missed)} of {len(self.told)} fixes"
            f"{self._not()}"
        )

    def _not(self) -> str:
        if not self.missed:
            return ""
        times = [f"{(one.event.last_ns - self.field.plan.origin_ns) / NS:.1f} s" for one in self.missed]
        more = f" and {len(times) - NAMED} more" if len(times) > NAMED else ""
        return f", not of that at {', '.join(times[:NAMED])}{more}"

    def doubtful(self) -> Iterator[str]:
        """What is likely to go wrong."""
        yield from self.backbone.doubtful()
        if self.told and len(self.missed) == len(self.told):
            yield (
                f"the camera cannot be turned to the target of any fix: by then all are more than {EVI_D30.pan:g} "
                f"degrees of pan from where it stands ({self.mount.heading_deg:.0f} degrees anticlockwise from east); "
                "turn it (camera.heading_deg), or move it (camera.x_m, camera.y_m)"
            )


def _time(seconds: float) -> str:
    return f"{seconds:.3g} s" if seconds >= 1 else f"{1000 * seconds:.3g} ms"
