"""What became of a track, in the words that stand in tables, pages and metrics.json."""

from __future__ import annotations

from typing import Any, Final, Literal

Verdict = Literal["tracked", "tracked with gaps", "lost"]
TRACKED: Final = "tracked"
WITH_GAPS: Final = "tracked with gaps"
LOST: Final = "lost"
WITHIN: Final = 0.95
"""A track that was within ``lost_m`` in this share of the steps was there ..."""
LEAST: Final = 0.5
"""... and one that was so in less than this share was not."""
BLACKOUT_STEPS: Final = 5
"""A track may be missing for so many steps in a row."""


def verdict(*, lost: bool, share_within: float | None, blackout_steps: int) -> Verdict | None:
    """*lost* by the scenario's rule or if the target was followed in less than half of the steps; else *tracked*, or
    *tracked with gaps* if it was missing for long or often. None where no step can be judged.
    """
    if share_within is None:
        return None
    if lost or share_within < LEAST:
        return LOST
    return TRACKED if share_within >= WITHIN and blackout_steps <= BLACKOUT_STEPS else WITH_GAPS


def told(figures: dict[str, Any]) -> str:
    """The verdict on a tracker as a page or table says it."""
    if figures["verdict"] is None:
        return "no truth to judge by" if figures["gap"]["steps"] else "no step to judge"
    return str(figures["verdict"])
