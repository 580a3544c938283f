"""What must hold of a run that chaos befell."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Generator, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

import pyarrow.parquet as pq

from launcher.plan.prepare import load, planned
from launcher.records import Plan
from launcher.run import run_virtual
from tests.chaos.deeds import DISK, LAUNCHER, SPEED, Case, Done, Phase
from tests.running import METRICS
from tests.same_tables import IDENTITY
from trackfield.role import NS

BEHIND_S: Final = 1.5
"""How far (wall time) what is on the disk may lag behind what happened, with some allowance for a busy machine."""
SEEN_S: Final = 2.0
"""A stop that lasts so long (wall time) is noticed."""
ENDING: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Signals that let a launcher end its run in order."""
RECOVER_S: Final = 120.0


@dataclass(frozen=True)
class Aftermath:
    """A run after all, and how it ended: the exit code (negative: a signal; None: it hung), and what it said."""

    case: Case
    folder: Path
    code: int | None
    said: str
    done: tuple[Done, ...]
    took_s: float
    left: tuple[str, ...] = ()

    def befell(self, *whom: str) -> list[Done]:
        return [one for one in self.done if one.deed.whom in whom]

    @property
    def launcher_died(self) -> bool:
        return self.code in (-signal.SIGKILL, -signal.SIGQUIT)


def complaints(after: Aftermath) -> Iterator[str]:
    """All that does not hold."""
    if after.code is None:
        yield f"does not end: {after.took_s:.0f} s, and it said {after.said[-500:]}"
        return
    yield from after.left
    yield from _exit_code(after)
    yield from _texts(after)
    if not (after.folder / "manifest.json").exists():
        if not any(one.phase is Phase.STARTING for one in after.done):
            yield "there is no run folder"
        return
    whole = yield from _recovered(after)
    if whole:
        yield from _tables(after)


def _exit_code(after: Aftermath) -> Iterator[str]:
    """That of the launcher's end, of a failure, or of a signal; 0 only where nothing came in time or to notice."""
    killed = {-one.deed.number for one in after.befell(LAUNCHER) if one.deed.number in (signal.SIGKILL, signal.SIGQUIT)}
    ended = {128 + one.deed.number for one in after.befell(LAUNCHER) if one.deed.number in (*ENDING, signal.SIGQUIT)}
    if not (after.folder / METRICS).exists():  # it came before the program handled signals, or after a failed start
        killed |= {-one.deed.number for one in after.befell(LAUNCHER)}
    others = [one for one in after.done if one.deed.whom != LAUNCHER]
    allowed = killed | ended | ({1} if others or any(one.deed.for_s for one in after.done) else set())
    if not any(_must_be_told(one) for one in after.done):
        allowed.add(0)
    if after.code not in allowed:
        yield f"exit code {after.code}, expected {sorted(allowed)}: {after.said[-700:]}"


def _must_be_told(one: Done) -> bool:
    """Whether a run may not end with exit code 0 after this."""
    if one.phase is not Phase.RUNNING or one.deed.whom == DISK:
        return False
    if one.deed.number == signal.SIGSTOP:
        return one.deed.whom != LAUNCHER and (one.deed.for_s or 0) >= SEEN_S
    return True


def _ends(one: Done) -> bool:
    return one.deed.number != signal.SIGSTOP


def _texts(after: Aftermath) -> Iterator[str]:
    logs = after.folder / "logs"
    texts = {file.name: file.read_text(errors="replace") for file in sorted(logs.iterdir())} if logs.exists() else {}
    for name, text in {**texts, "stderr": after.said}.items():
        if "Traceback" in text:
            yield f"a traceback in {name}: {text[text.index('Traceback') :][:900]}"


def trackfield(*arguments: object) -> tuple[int, str]:
    """How a command ends, and what it says on stderr."""
    command = [sys.executable, "-m", "launcher", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=RECOVER_S, check=False)
    return done.returncode, done.stderr


def _metrics(folder: Path) -> dict[str, Any] | None:
    try:
        found = json.loads((folder / METRICS).read_text())
    except (OSError, ValueError):
        return None
    return found if isinstance(found, dict) else None


def _recovered(after: Aftermath) -> Generator[str, None, bool]:
    """A folder is complete, or says that it is not, or ``recover`` makes it so. Returns whether it has tables."""
    metrics = _metrics(after.folder)
    logged = (after.folder / "record.log").exists()
    if metrics is None or (logged and not metrics.get("complete")):
        if not logged:
            if any(one.phase is Phase.STARTING for one in after.done):
                return False  # it ended before there was anything to record
            yield f"neither figures nor a log to recover them from: {sorted(f.name for f in after.folder.iterdir())}"
            return False
        code, said = trackfield("recover", after.folder)
        if code or "Traceback" in said:
            yield f"recover ends with {code}: {said[-700:]}"
            return False
        metrics = _metrics(after.folder)
    if metrics is None:
        yield "no figures, even after recover"
        return False
    yield from _figures(after, metrics)
    code, said = trackfield("report", after.folder)
    if code or "Traceback" in said:
        yield f"report ends with {code}: {said[-700:]}"
    return True


def _figures(after: Aftermath, metrics: dict[str, Any]) -> Iterator[str]:
    frames = metrics["frames"]
    parts = [frames["delivered"], *frames["lost"].values(), frames["host_lost"], frames["host_late"]]
    if frames["expected"] is None:
        yield "the figures are empty"
    elif None in parts and not metrics.get("complete"):
        pass  # nobody could tell: its processes were gone
    elif frames["expected"] != sum(parts):
        yield f"the ledger does not close: {frames}"
    if not isinstance(metrics.get("complete"), bool) or not metrics.get("end_reason"):
        yield f"does not say how it ended: {metrics.get('complete')}, {metrics.get('end_reason')!r}"
    if metrics.get("complete") and any(one.phase is Phase.STARTING for one in after.befell(LAUNCHER) if _ends(one)):
        yield f"says that it is complete, and was ended before it began: {metrics['end_reason']!r}"
    if after.launcher_died or (after.befell(DISK) and not metrics.get("complete")):
        return  # who knew of deaths is gone, or could not write them down: the terminal has them
    told = {death["id"] for death in metrics["processes"]["died"]} | {s["id"] for s in metrics["processes"]["stopped"]}
    for one in after.done:
        if _must_be_told(one) and one.deed.whom not in (LAUNCHER, "zygote") and one.name not in told:
            yield f"{one.deed} befell {one.name}, which is neither in died nor in stopped: {sorted(told)}"


@cache
def _plan(case: Case) -> Plan:
    return planned(load("spcpf", settings=list(case.settings), nodes=9), SPEED)


@cache
def _undisturbed(case: Case) -> Counter[tuple[Any, ...]]:
    """Which frames the field would have sent."""
    with tempfile.TemporaryDirectory() as scratch:
        (Path(scratch) / "logs").mkdir()
        run_virtual(_plan(case), Path(scratch))
        return _frames(Path(scratch))


def _frames(folder: Path) -> Counter[tuple[Any, ...]]:
    table = pq.read_table(folder / "messages.parquet")
    return Counter(zip(*(table[name].to_pylist() for name in IDENTITY), strict=True))


def _tables(after: Aftermath) -> Iterator[str]:
    """All frames are there that were sent until shortly before the first thing that could end the recording.

    Only where the field itself was left alone, and the machine handled its events in order: otherwise nobody knows
    what it would have sent.
    """
    try:
        found = _frames(after.folder)
        pq.read_table(after.folder / "tracks.parquet")
    except (OSError, ValueError) as error:
        yield f"tables cannot be read: {error}"
        return
    timing = (_metrics(after.folder) or {}).get("timing", {})
    if after.befell("node", "fusion", "router") or timing.get("host_late"):
        return
    until_ns = _recorded_until(after)
    wanted = Counter({frame: n for frame, n in _undisturbed(after.case).items() if frame[0] < until_ns})
    if missing := wanted - found:
        yield f"{missing.total()} of {wanted.total()} frames are lost, first {min(missing)}"


def _recorded_until(after: Aftermath) -> float:
    """Up to which instant (emulated ns) the tables must hold all that was sent."""
    ended_s = (_metrics(after.folder) or {}).get("ended_s")
    until_ns = float("inf") if ended_s is None else _plan(after.case).origin_ns + ended_s * NS
    for one in after.befell("recorder", "zygote", LAUNCHER):
        if one.deed.for_s is None and one.deed.number not in ENDING:
            until_ns = min(until_ns, 0 if one.t_ns is None else one.t_ns - BEHIND_S * SPEED * NS)
    return until_ns
