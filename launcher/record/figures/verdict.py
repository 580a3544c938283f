"""The verdict on a track, in the words of tables, pages and metrics.json."""

from __future__ import annotations

from typing import Any, Final, Literal

Verdict = Literal["tracked", "tracked with gaps", "lost"]
TRACKED: Final = "tracked"
WITH_GAPS: Final = "tracked with gaps"
LOST: Final = "lost"
WITHIN: Final = 0.95
"""From this share of the steps with the track within ``lost_m``, it counts as tracked ..."""
LEAST: Final = 0.5
"""... and below this share as lost."""
BLACKOUT_STEPS: Final = 5
"""A tracked target may be without a track for so many steps in a row."""


def verdict(*, lost: bool, share_within: float | None, blackout_steps: int) -> Verdict | None:
    """*lost* by the scenario's rule or if the target was followed in less than half of the steps; else *tracked*, or
    *tracked with gaps* if the track was missing for long or often. None where no step can be judged.
    """
    if share_within is None:
        return None
    if lost or share_within < LEAST:
        return LOST
    return TRACKED if share_within >= WITHIN and blackout_steps <= BLACKOUT_STEPS else WITH_GAPS


def told(figures: dict[str, Any]) -> str:
    """The verdict on a tracker as pages and tables show it."""
    if figures["verdict"] is None:
        return "no truth to judge by" if figures["gap"]["steps"] or figures["steps_expected"] else "no step to judge"
    return str(figures["verdict"])
