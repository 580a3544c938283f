"""How much of their time sensors are awake: their radios send, receive or listen."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from itertools import pairwise
from math import fsum

from launcher.record.diary import Diary
from launcher.record.figures.energy import Battery
from launcher.records import SENSES, Plan
from trackfield.drivers.engine.receiver import open_ns
from trackfield.link.fate import FIELD


def awake_share(plan: Plan, diaries: Iterable[Diary], batteries: Sequence[Battery]) -> dict[str, float | None]:
    """``awake_share`` of metrics.json: of the time since the first step, mean of the sensors and the most awake one.

    What is metered since the start of the run, less the time before the first step in which the receiver was open.
    Null where no energy of sensors is metered.
    """
    sensors = {place.id for place in plan.info.tagged(SENSES)}
    lives = defaultdict[str, list[Diary]](list)
    for diary in diaries:
        lives[diary.spec.id].append(diary)
    shares = []
    for one in batteries:
        if one.spec.id not in sensors:
            continue
        before = [_before(diary, plan.origin_ns) for diary in lives[one.spec.id]]
        radio = one.activity
        awake_ns = radio.send_ns + radio.receive_ns + radio.listen_ns
        whole_ns = awake_ns + radio.sleep_ns - sum(lived_ns for lived_ns, _ in before)
        if whole_ns > 0:
            shares.append(min(max(awake_ns - sum(opened_ns for _, opened_ns in before), 0) / whole_ns, 1.0))
    return {"mean": fsum(shares) / len(shares), "most": max(shares)} if shares else {"mean": None, "most": None}


def _before(diary: Diary, origin_ns: int) -> tuple[int, int]:
    """How long a life lasted before the first step, and how much of that its receiver was open (ns)."""
    start_ns, until_ns = diary.spec.start_ns, origin_ns
    for end_ns in (diary.spec.kill_ns, None if diary.died is None else diary.died[0]):
        until_ns = until_ns if end_ns is None else min(until_ns, end_ns)
    if until_ns <= start_ns:
        return 0, 0
    edges = [(max(t_ns, start_ns), opening) for t_ns, opening in diary.awake(FIELD) if t_ns < until_ns]
    spans = pairwise([*edges, (until_ns, False)])
    return until_ns - start_ns, sum(open_ns(opening, t_ns, next_ns) for (t_ns, opening), (next_ns, _) in spans)
