"""How full the channel was, and what its frames would have done to each other."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from launcher.plan.air import CAPTURE_DB
from launcher.record.figures.channel import RULE, is_fiction, lost_share
from launcher.report.cells import NOTHING, percent
from launcher.report.folder import Run
from launcher.report.parts.machine import Line
from launcher.report.style import Figures

FIGURES: Final[Figures] = {}
MEANING: Final = (
    "The model decides the fate of each frame alone: no frame is lost because of another, and a radio that sends hears "
    "as well as one that does not. These figures are counted afterwards, from what was on the air where and how strong "
    "it was there. Of the frames that overlapped another one, those count as lost that were not captured; radios that "
    "listen before they send would have kept some of them apart, and repeats would have saved some: these do not "
    "count. "
)


def contents(run: Run) -> dict[str, Any]:
    """See ``Part``."""
    return {"lines": lines(run), "meaning": MEANING + RULE}


def lines(run: Run) -> list[Line]:
    """The figures of metrics.json; none if there was no radio."""
    channel, bad = run.metrics["channel"], is_fiction(run.metrics)
    if channel["use_mean"] is None:
        return []
    shares = {name: NOTHING if share is None else percent(share) for name, share in channel.items()}
    return [
        ("time in which the channel was in use, where that was most", shares["use_mean"], _full(channel)),
        ("the same in the busiest second", shares["use_peak"], False),
        ("frames that overlapped another one at their receiver", shares["overlapped_share"], False),
        (f"of these, captured: {CAPTURE_DB:g} dB stronger than all others", shares["captured_share"], False),
        ("frames that came while their receiver was sending", shares["deaf_share"], False),
        ("frames that the model lost by radio", percent(lost_share(run.metrics["frames"])), bad),
        ("frames delivered that would have been lost to overlaps or by receivers sending", shares["spared_share"], bad),
    ]


def _full(channel: Mapping[str, Any]) -> bool:
    """Whether it was in use for too much of the run."""
    return channel["use_limit"] is not None and (channel["use_mean"] or 0.0) >= channel["use_limit"]
