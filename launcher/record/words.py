"""Figures of a run in words, for a terminal and for a report alike."""

from __future__ import annotations

from typing import Any


def span(seconds: float) -> str:
    """A time that may be a minute or a year."""
    for unit, length in (("days", 86_400), ("h", 3_600), ("min", 60)):
        if seconds >= 2 * length:
            return f"{seconds / length:.1f} {unit}"
    return f"{seconds:.1f} s"


def alarms(metrics: dict[str, Any]) -> list[str]:
    """What makes a run's figures doubtful."""
    found = []
    frames, timing = metrics["frames"], metrics["timing"]
    if timing["host_late"]:
        found.append(
            f"timing: {timing['host_late']} events came too late on this machine to be put in order without a trace "
            "(timing.host_late): a lower --speed, or --virtual, is exact"
        )
    if frames["expected"] and not frames["delivered"]:
        found.append(f"the link delivered none of {frames['expected']} frames: no tracker had anything to go by")
    if not frames["expected"]:
        found.append("no frame was sent: no tracker had anything to go by")
    return found
