"""What the processes of a camera told, from their diaries."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from typing import Any, Final

from pydantic import ValidationError

from launcher.outside import CONTROL, Outside
from launcher.record.diary import Diary
from launcher.record.outside.rows import ROWS
from launcher.records import Plan
from trackfield.models.pointing import Mount
from trackfield.role import Tell
from trackfield.words import quoted

TOPICS: Final = {
    "motion": "turns",
    "aimed": "aims",
    "exposed": "exposures",
    "gateway": "counts",
    "camera": "states",
    "order": "orders",
    "refused order": "refusals",
}
"""What is told of by topic (docs/architecture.md), and where it is kept."""


def mount_of(plan: Plan) -> Mount | None:
    """Where the camera stands; None if there is none."""
    control = next((one for one in plan.processes if one.role == CONTROL), None)
    return None if control is None else Mount(**control.config["mount"])


def outside_of(plan: Plan, diaries: Iterable[Diary]) -> tuple[Outside | None, list[str]]:
    """What these lives told; None without a camera. Then what is wrong with what they told, which is left out."""
    mount = mount_of(plan)
    if mount is None:
        return None, []
    found: dict[str, list[Any]] = {kind: [] for kind in ROWS}
    strange = Counter[str]()
    for diary in diaries:
        for topic, values in _told(diary, plan.run.end_ns):
            kind = TOPICS.get(topic)
            if kind is None:
                strange[f"{diary.spec.id} told of {quoted(topic)}, which nobody knows"] += 1
                continue
            try:
                found[kind].append(ROWS[kind].row(values))
            except ValidationError:
                strange[f"{diary.spec.id} told of {quoted(topic)} what cannot be"] += 1
    rows = {kind: tuple(sorted(several)) for kind, several in found.items()}
    return Outside(mount, **rows), [f"{why} ({count} times)" for why, count in strange.items()]


def _told(diary: Diary, end_ns: int) -> Iterator[tuple[str, tuple[Any, ...]]]:
    """(topic, its row) of all that a life told."""
    who: dict[str, tuple[Any, ...]] = {"gateway": (diary.spec.incarnation,), "refused order": (diary.spec.id,)}
    for told in diary.told:
        if isinstance(told.effect, Tell) and told.key[0] <= end_ns:
            topic = told.effect.topic
            yield topic, (told.key[0], *who.get(topic, ()), *told.effect.values)
