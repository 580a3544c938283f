"""What happened in a run, by name: a campaign in which something of it never happened proves less than it says."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from launcher.record.diary import Diary
from launcher.record.metrics import CAUSES
from tests.campaign.cases import TALKERS, Case
from tests.campaign.fields import OF_SENSORS
from tests.campaign.verdicts import Run
from tests.protocols.parties import KINDS
from trackfield.role import Corrected, Listen, Store

MODELS: Final = ("ideal", "fixed", "gilbert_elliott", "lognormal_prr", "csma154")
PROVOKED: Final = frozenset(
    {
        *(f"talkers: {talkers}" for talkers in TALKERS),
        *(f"link: {model}" for model in MODELS),
        *(f"a frame lost: {cause}" for cause in CAUSES),
        *(f"a lost {kind}" for kinds in KINDS.values() for kind in kinds),
        *(f"a sensor: {fault}" for fault in OF_SENSORS),
        "a frame used late",
        "a frame ignored",
        "a frame on another medium",
        "a link with bursts",
        "a radio of its own power",
        "a receiver in windows",
        "a track",
        "a clock set",
        "a clock that jumps",
        "an empty battery",
        "a kill",
        "a restart",
        "a restart with what was stored",
    }
)
"""All that a campaign should provoke, in virtual time already."""
RETRACTION: Final = "a frame taken back"
"""What runs as processes should provoke besides."""


def happened(case: Case, run: Run) -> Iterator[str]:
    """What happened in a run in virtual time; some of it more than once."""
    yield f"talkers: {case.talkers}"
    yield f"link: {run.plan.run.link['model']}"
    for row in run.ledger.rows:
        if row.outcome in CAUSES:
            yield f"a frame lost: {row.outcome}"
            yield f"a lost {row.kind}"
        elif row.outcome in ("late", "ignored"):
            yield "a frame used late" if row.outcome == "late" else "a frame ignored"
    if any(row.medium != "field" for row in run.ledger.rows):
        yield "a frame on another medium"
    if "burst_loss" in run.plan.run.link:
        yield "a link with bursts"
    if any(p.tx_dbms for p in run.plan.processes):
        yield "a radio of its own power"
    if any(isinstance(effect, Listen) for diary in run.ledger.diaries.values() for _, effect in diary.radio):
        yield "a receiver in windows"
    if any(row.point.mean for row in run.tracks):
        yield "a track"
    for diary in run.ledger.diaries.values():
        yield from _befell(diary, run)


def _befell(diary: Diary, run: Run) -> Iterator[str]:
    """What happened to a life, if it was one."""
    spec, end_ns = diary.spec, run.plan.run.end_ns
    ends_ns = min(end_ns if spec.kill_ns is None else spec.kill_ns, end_ns)
    if diary.died is not None:
        yield "an empty battery"
        ends_ns = min(ends_ns, diary.died[0])
    elif ends_ns < end_ns:
        yield "a kill"
    if any(isinstance(told.effect, Corrected) for told in diary.told):
        yield "a clock set"
    if any(spec.start_ns < at < ends_ns for at, _ in spec.jumps):
        yield "a clock that jumps"
    for fault in spec.faults:
        if fault["from_ns"] < ends_ns:
            yield f"a sensor: {fault['kind']}"
    if spec.incarnation and diary.told:
        yield "a restart"
        before = run.ledger.diaries[spec.before]
        if any(isinstance(told.effect, Store) for told in before.told):
            yield "a restart with what was stored"
