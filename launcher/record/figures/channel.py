"""How full the channel of a run was: what its radios did to each other, or would have done.

Computed afterwards from all frames that left and all places; no frame of the run was lost by it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

from launcher.plan.air import FEW, FULL, MUCH, SOME, Air, Due, air_of, flatters
from launcher.record.ledger import Ledger
from trackfield.drivers.spec import places_of
from trackfield.link.fate import Transmission
from trackfield.role import NEIGHBOURHOOD

SHARES: Final = ("overlapped_share", "captured_share", "deaf_share", "spared_share")


def air_of_run(ledger: Ledger) -> Air | None:
    """What was on the air in a run that is settled, up to its end; None if no radio sent anything."""
    end_ns = ledger.run.end_ns
    frames = [frame for frame in ledger.aired if frame.sent_ns < end_ns]
    places = places_of(diary.spec for diary in ledger.diaries.values())
    return air_of(ledger.link, places, frames, _dues(ledger, frames), end_ns)


def _dues(ledger: Ledger, frames: list[Transmission]) -> Iterator[Due]:
    """These frames at those who they were for."""
    numbers = {_key(frame, frame.dst): number for number, frame in enumerate(frames)}
    for row in ledger.rows:
        if row.outcome != "overflow":
            number = numbers.get(_key(row, row.dst), numbers.get(_key(row, NEIGHBOURHOOD)))
            if number is not None:
                yield Due(number, row.dst, row.delivered)


def _key(frame: Any, to: str) -> tuple[str | int, ...]:
    """What tells frames apart, of a frame or of its row."""
    return frame.src, frame.kind, frame.sent_ns, frame.copy, frame.medium, to


def channel_metrics(air: Air | None) -> dict[str, Any]:
    """``channel`` of metrics.json; null where no radio sent anything.

    Use is that at the process at which it was highest; shares are of the frames expected at all of them, the captured
    of the overlapped ones.
    """
    if air is None:
        return dict.fromkeys(("use_mean", "use_peak", "use_limit", *SHARES))
    counts = (air.overlapped, air.expected), (air.captured, air.overlapped), (air.deaf, air.expected)
    shares = [part / of if of else None for part, of in (*counts, (air.spared, air.expected))]
    return {
        "use_mean": max((use.mean for use in air.uses), default=None),
        "use_peak": max((use.peak for use in air.uses), default=None),
        "use_limit": air.use_limit,
        **dict(zip(SHARES, shares, strict=True)),
    }


def lost_share(frames: Mapping[str, Any]) -> float:
    """The share of the frames expected at their hearers that the model lost on its links, of a metrics.json."""
    return float(frames["lost"]["radio"] / frames["expected"]) if frames["expected"] else 0.0


def is_fiction(metrics: Mapping[str, Any]) -> bool:
    """Whether what the model leaves out makes the losses of a run a fiction (docs/metrics.md)."""
    channel, frames = metrics["channel"], metrics["frames"]
    if channel["spared_share"] is None:
        return False
    expected = frames["expected"]
    return flatters(
        channel["spared_share"] * expected, frames["lost"]["radio"], expected, channel["use_mean"], channel["use_limit"]
    )


RULE: Final = (
    f"The losses of a run are a fiction, and lines are red, where at least {MUCH:.0%} of all frames would have been "
    f"lost besides; where the model lost at least {SOME:.0%}, and would have lost more than as many again; or where "
    f"radios listen before they send and the channel was in use for at least {FULL:.0%} of the run. Fewer than "
    f"{FEW:.0f} frames do not count."
)
"""When losses are a fiction, in words."""
