"""``[camera]``: what is beyond the gateway of a field, and points at targets that are fixed there (Yang et al.)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Final, Literal

from pydantic import Field, model_validator

from trackfield.scenario.quantities import MOST_NODES, Coordinate, Duration, Instant
from trackfield.scenario.section import Section, Word, one_of, wrong

MOST_HOPS: Final = 16
MOST_ORDERS: Final = 1000


class CameraSection(Section):
    """A camera, or none; ``kind`` is its name."""

    kind: str


class NoCamera(CameraSection):
    """No camera, and no gateway."""

    kind: Literal["none"] = Field(default="none", description="no camera: nothing leaves the field")


_Order = tuple[Instant, Literal["status", "start", "stop"], Word]


class EviD30(CameraSection):
    """A Sony EVI-D30 that is told by VISCA where to look, with all that it takes to get a fix from the field to it."""

    kind: Literal["evi-d30"] = Field(
        default="evi-d30",
        description="a Sony EVI-D30: a gateway lets fixes out of the field, camera control predicts and points it, "
        "video is captured, system control starts and stops the rest",
    )
    x_m: Coordinate = Field(default=30.0, description="where the camera stands, and its control, east")
    y_m: Coordinate = Field(default=-25.0, description="and north")
    z_m: Annotated[float, Field(ge=0.1, le=1000)] = Field(default=2.0, description="height of its lens")
    heading_deg: Annotated[float, Field(ge=-360, le=360)] | None = Field(
        default=None,
        description="where it looks at pan 0, anticlockwise from east; unset: at the middle of the sensors",
    )
    predict: bool = Field(
        default=True,
        description="it looks where the target will be when it has turned there; false: where the target was last",
    )
    shot_s: Duration = Field(
        default=4.0, description="video of a shot lasts so long, from when the camera begins to turn"
    )
    frames_s: Annotated[float, Field(ge=0.1, le=100)] = Field(default=10.0, description="frames of it per second")
    hops: Annotated[tuple[tuple[Coordinate, Coordinate], ...], Field(max_length=MOST_HOPS)] = Field(
        default=(),
        json_schema_extra={"expected": f"a list of up to {MOST_HOPS} [x_m, y_m]"},
        description="where nodes stand that forward from the gateway to camera control; none: it is next to it",
    )
    hop_s: Annotated[float, Field(ge=0, le=60)] = Field(
        default=0.02, description="each of them takes so long to hand on"
    )
    passes: Annotated[tuple[Literal["fixes", "misses"], ...], Field(min_length=1, max_length=2)] = Field(
        default=("fixes",),
        json_schema_extra={"expected": "a list of fixes, misses"},
        description="what the gateway lets through: fixes, events without a fix",
    )
    heads: Annotated[tuple[Word, ...], Field(max_length=MOST_NODES)] | None = Field(
        default=None, description="ids of the only nodes of which it lets something through; unset: of all"
    )
    queue: Annotated[int, Field(ge=1, le=1000)] = Field(
        default=8, description="so many items wait in the gateway; of more the oldest fixes are dropped"
    )
    orders: Annotated[tuple[_Order, ...], Field(max_length=MOST_ORDERS)] = Field(
        default=(),
        json_schema_extra={"expected": "a list of [s, 'status', 'start' or 'stop', id of a process]"},
        description="what system control orders when, such as [[30, 'stop', 'video']]",
    )

    @model_validator(mode="after")
    def _once(self) -> EviD30:
        for name in ("passes", "heads"):
            listed = getattr(self, name) or ()
            if len(set(listed)) < len(listed):
                raise wrong("has something twice", "each of them once", f"camera.{name}")
        return self


CAMERAS: Final[tuple[type[CameraSection], ...]] = (NoCamera, EviD30)

if TYPE_CHECKING:
    Camera = CameraSection
else:
    Camera = one_of(CAMERAS, "kind")
