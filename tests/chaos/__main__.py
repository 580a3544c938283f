"""The campaign of chaos: small real runs whose processes are killed, stopped and signalled at any instant.

    python -m tests.chaos [--runs 60] [--seed 1]

Each seed draws a run and one to five deeds: SIGKILL, SIGSEGV, SIGSTOP and SIGCONT of a node, the fusion centre, the
router, the recorder, the zygote or the launcher; SIGINT, SIGTERM, SIGHUP and SIGQUIT of the launcher; and a disk that
is full for a while (as root: the run gets a small disk of its own). Each run must end in time, leave nothing behind,
have the right exit code, and leave a folder that can be read, or recovered, and tells what happened. A seed that fails
is printed as the command that repeats it.
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import time
import uuid
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

import psutil

from tests.chaos.deeds import DISK, SPEED, Case, Doer, Done, Phase, case_of, small_disk
from tests.chaos.verdicts import Aftermath, complaints
from tests.running import Run

PATIENCE_S: Final = 60.0
"""How much longer than planned a run may take: less than the launcher's own time-outs together."""
LEAVE_S: Final = 15.0
"""How long after the launcher's end the last of its processes may be there: an orphaned recorder writes its tables."""
NEXT: Final = ("spcpf", "--nodes", "4", "--set", "target.steps=1", "--speed", "10")
MARK: Final = "TRACKFIELD_CHAOS"
"""An environment variable by which all processes of a run are known, whoever their parents are."""


def aftermath(case: Case, home: Path) -> tuple[Aftermath, list[str]]:
    """Let a run happen, with all that befalls it; and what is wrong with it."""
    with small_disk(home / "disk") as there:
        deeds = [deed for deed in case.deeds if there or deed.whom != DISK]
        case = case_of(case.seed, *deeds)
        after = _lived(case, home)
        return after, list(complaints(after))


def _lived(case: Case, home: Path) -> Aftermath:
    temporary, mark = home / "tmp", uuid.uuid4().hex
    temporary.mkdir()
    begun = time.monotonic()
    run = _started(home / "disk" / "run", case.arguments, temporary, mark)
    doer = Doer(case, run)
    doing = doer.start()
    code: int | None = None
    last_s = max((deed.at_s + (deed.for_s or 0) for deed in case.deeds), default=0.0)
    with suppress(subprocess.TimeoutExpired):
        code = run.process.wait((case.steps + 1) / SPEED + last_s + PATIENCE_S)
    took_s = time.monotonic() - begun
    doing.join(30)
    left = tuple(_left(mark, temporary))
    return Aftermath(case, run.folder, code, run.said(), tuple(doer.done), took_s, left)


def _started(folder: Path, arguments: Sequence[str], temporary: Path, mark: str) -> Run:
    """A run whose processes are marked, and whose temporary files go here."""
    before = dict(os.environ)
    # Titles of processes would be written over their environments.
    os.environ |= {MARK: mark, "SPT_NOENV": "1", "TMPDIR": str(temporary)}
    try:
        return Run(folder, *arguments, said=temporary.with_name(f"{folder.name}.said"))
    finally:
        os.environ.clear()
        os.environ.update(before)


def _left(mark: str, temporary: Path) -> Iterator[str]:
    """What a run left behind: processes, and files beside its folder."""
    deadline = time.monotonic() + LEAVE_S
    while (there := _marked(mark)) and time.monotonic() < deadline:
        time.sleep(0.1)
    for process in there:
        with suppress(psutil.Error):
            yield f"left behind: {' '.join(process.cmdline())}"
    _clear(mark)
    if remains := list(temporary.iterdir()):  # of a launcher that was killed: the next run removes it, a minute later
        for folder in remains:
            os.utime(folder, (0, 0))
        _started(temporary.parent / "next", NEXT, temporary, "").finish()
    if names := sorted(file.name for file in temporary.iterdir()):
        yield f"left behind in the folder for temporary files: {names}"


def _marked(mark: str) -> list[psutil.Process]:
    """All processes of a run."""
    found = []
    for process in psutil.process_iter():
        with suppress(psutil.Error):
            if process.status() != psutil.STATUS_ZOMBIE and process.environ().get(MARK) == mark:
                found.append(process)
    return found


def _clear(mark: str) -> None:
    for process in _marked(mark):
        with suppress(psutil.Error):
            process.kill()


# --- the campaign -----------------------------------------------------------------------------------------------------


def failures(seed: int) -> tuple[list[str], list[Done]]:
    """What is wrong with the run of a seed, and what befell it."""
    with tempfile.TemporaryDirectory(prefix="ch-") as scratch:
        after, wrong = aftermath(Case(seed), Path(scratch))
        return wrong, list(after.done)


def campaign(seeds: Sequence[int], say: Callable[[str], object] = print) -> int:
    """The exit code: 1 if any seed fails."""
    begun, failed, befell = time.monotonic(), 0, Counter[tuple[str, Phase]]()
    for seed in seeds:
        wrong, done = failures(seed)
        befell.update((_kind(one), one.phase) for one in done)
        if wrong:
            failed += 1
            say(f"seed {seed} fails: python -m tests.chaos --runs 1 --seed {seed}")
            say("  befell: " + "; ".join(f"{one.deed} ({one.name}, {one.phase.value})" for one in done))
            for what in wrong[:5]:
                say("  " + what.replace("\n", "\n  "))
    for line in table(befell):
        say(line)
    say(f"{len(seeds)} runs, {befell.total()} deeds, in {time.monotonic() - begun:.0f} s: {failed} failed")
    return int(failed > 0)


def _kind(one: Done) -> str:
    return "disk full" if one.deed.whom == DISK else f"{one.deed.whom} {signal.Signals(one.deed.number).name}"


def table(befell: Counter[tuple[str, Phase]]) -> list[str]:
    """What befell runs, and when."""
    phases = [Phase.STARTING, Phase.RUNNING, Phase.CLOSING]
    head = " | ".join(phase.value for phase in phases)
    lines = [f"| what befell a run | {head} |", "| --- |" + " --- |" * len(phases)]
    for kind in sorted({kind for kind, _ in befell}):
        lines.append(f"| {kind} | " + " | ".join(str(befell[kind, phase]) for phase in phases) + " |")
    return lines


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1, help="of the first run")
    asked = parser.parse_args()
    return campaign(range(asked.seed, asked.seed + asked.runs))


if __name__ == "__main__":
    sys.exit(main())
