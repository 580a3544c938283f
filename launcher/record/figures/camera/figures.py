"""``camera`` of metrics.json with types."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from launcher.record.figures.frames import Count, Figures, Number


class Spread95(Figures):
    """Mean, the value that 95 % stay below, and maximum."""

    mean: Number | None
    p95: Number | None
    max: Number | None


class InFrame(Figures):
    """Whether targets were in the picture: at the instants for which the camera was aimed, and in frames."""

    at_aim: Number | None
    aims: Count
    frames: Number | None
    frames_n: Count
    shots: Number | None


class TargetShots(InFrame):
    """The same of the ``n`` shots of one target."""

    n: Count


class CameraLost(Figures):
    """How often camera control lost the camera, and for how long, emulated s."""

    times: Count
    s: Number


class GatewayFigures(Figures):
    """Items of a gateway: acknowledged, refused by its rules, dropped, without a subscriber; the most that waited."""

    passed: Count
    refused: Count
    dropped: Count
    unwanted: Count
    queue_max: Count


class Orders(Figures):
    """Orders of system control by how they ended."""

    ok: Count
    refused: Count
    unknown: Count
    silent: Count


class CameraFigures(Figures):
    """What became of the fixes that camera control had, and whether targets were in the picture."""

    fixes: Count
    shots: Count
    replaced: Count
    outcomes: Mapping[str, Count]
    in_frame: InFrame
    delay_s: Spread95
    slew_s: Spread95
    first_seen_s: Spread95
    place_m: Spread95
    pan_deg: Spread95
    tilt_deg: Spread95
    lost: CameraLost
    gateway: GatewayFigures
    orders: Orders
    refused_orders: Count
    targets: Mapping[str, TargetShots]


def in_study(camera: CameraFigures | None) -> dict[str, float | None]:
    """What the table of a study has of it, by their names there."""
    found: dict[str, float | None] = dict.fromkeys(OF_CAMERA)
    if camera is not None:
        values = (
            *(camera.in_frame.at_aim, camera.in_frame.frames, camera.in_frame.shots),
            *(camera.delay_s.mean, camera.place_m.mean, float(camera.gateway.dropped)),
        )
        found |= zip(OF_CAMERA, values, strict=True)
    return found


OF_CAMERA: Final = (
    *("camera.in_frame.at_aim", "camera.in_frame.frames", "camera.in_frame.shots"),
    *("camera.delay_s.mean", "camera.place_m.mean", "camera.gateway.dropped"),
)
