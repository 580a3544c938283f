"""What must hold of a run that was attacked."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import pyarrow.parquet as pq

from tests.hostile.field import undisturbed
from tests.running import kept_up
from tests.same_tables import frames, points, track_differences

CONTROL: Final = re.compile(r"[^\S \n]|[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069]")
"""What must not reach a terminal: control characters, and those that reverse the direction of a line."""
LOG_LINES: Final = 100
LOG_BYTES: Final = 50_000
INTERFERED: Final = "interfere"
"""Part of what a run says that was interfered with."""


@dataclass(frozen=True)
class Attacked:
    """A run after the attack, how it ended, and what was put into it (as of ``Peer``)."""

    seed: int
    folder: Path
    code: int
    said: str
    metrics: dict[str, Any]
    alarming: int = 0
    harmful: bool = False

    @property
    def kept_up(self) -> bool:
        """Whether the machine was fast enough."""
        return kept_up(self.metrics)


def complaints(run: Attacked) -> Iterator[str]:
    """All that does not hold; ``harmful`` samples may change tracks, if the run says so."""
    alarm = run.code == 1 and INTERFERED in run.said
    if run.code not in (0, 1):
        yield f"exit code {run.code}: {run.said[-500:]}"
    if run.code == 1 and not alarm:
        yield f"fails for another reason than the attack: {run.said[-700:]}"
    if run.alarming and not alarm:
        yield f"{run.alarming} samples that must raise the alarm did not: exit code {run.code}"
    yield from _figures(run, alarm)
    yield from _processes(run)
    yield from _texts(run)
    if not (alarm and run.harmful):
        yield from _unchanged(run)


def _figures(run: Attacked, alarm: bool) -> Iterator[str]:
    interference = {kind: n for kind, n in (run.metrics.get("interference") or {}).items() if n}
    if alarm and not interference:
        yield "says that it was interfered with, and metrics.json has no interference"
    if run.code == 0 and interference:
        yield f"ends with exit code 0 and counts {interference}"
    figures = run.metrics["frames"]
    if figures["expected"] is None:
        yield "has no tables"
    elif figures["expected"] != figures["delivered"] + sum(
        figures["lost"].values(), figures["host_lost"] + figures["host_late"]
    ):
        yield f"the ledger does not close: {figures}"
    if not alarm and (figures["host_lost"] or run.metrics["recorder"]["dropped"]):
        yield f"the machine is blamed: {figures['host_lost']} lost, {run.metrics['recorder']['dropped']} unseen"


def _processes(run: Attacked) -> Iterator[str]:
    for what in ("died", "stopped"):
        if run.metrics["processes"][what]:
            yield f"{what}: {run.metrics['processes'][what]}"


def _texts(run: Attacked) -> Iterator[str]:
    """No traceback, no control character and no flood of lines, in logs or on the terminal."""
    logs = {file.name: file.read_bytes() for file in sorted((run.folder / "logs").iterdir())}
    for name, raw in [*logs.items(), ("stderr", run.said.encode())]:
        text = raw.decode(errors="backslashreplace")
        if "Traceback" in text:
            yield f"a traceback in {name}: {text[text.index('Traceback') :][:600]}"
        if found := CONTROL.search(text):
            yield f"{found[0]!r} in {name}: {text[max(found.start() - 80, 0) : found.end() + 40]!r}"
        if len(raw) > LOG_BYTES or text.count("\n") > LOG_LINES:
            yield f"{text.count(chr(10))} lines, {len(raw)} bytes in {name}"


def _unchanged(run: Attacked) -> Iterator[str]:
    """Each point of each track, and the fate of each frame of the field, is that of the run without an attack."""
    twin = undisturbed(run.seed)
    try:
        tracks, messages = (pq.read_table(run.folder / f"{name}.parquet") for name in ("tracks", "messages"))
    except OSError as error:
        yield f"tables cannot be read: {error}"
        return
    if changes := track_differences(points(twin.tracks), points(tracks)):
        yield f"{len(changes)} values of tracks are changed, first {changes[0]}"
    if missing := frames(twin.messages) - frames(messages):
        yield f"{missing.total()} frames are missing or have another fate, one is {next(iter(missing))}"
