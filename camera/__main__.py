"""``python -m camera``: camera control, or with ``camera`` or ``video`` one of these, that joins a run by a router."""

from __future__ import annotations

from trackfield.drivers.standalone import main

ROLES = {"camera-control": "camera.control:Control", "camera": "camera.ptz:Camera", "video": "camera.video:Video"}

main("camera", ROLES, __doc__, installed=True)
