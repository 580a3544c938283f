"""Whether the working tree makes the same runs as an earlier version of the project, bit for bit.

    python -m tests.same_as COMMIT [--only s1] [--no-processes] [--keep FOLDER]

Both versions run the cases of ``tests/same_cases.py`` on this machine, each by its own code. Compared are all points of
all tracks, and what became of every frame. Exit code 0: all cases are the same; 1: not all; 2: nothing can be run.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from hashlib import blake2b
from itertools import chain
from pathlib import Path
from threading import Lock
from typing import Final, Self

import pyarrow.parquet as pq

from tests.running import METRICS, kept_up
from tests.same_cases import Case, cases
from tests.same_tables import differences

ROOT: Final = Path(__file__).parents[1]
TABLES: Final = ("tracks.parquet", "messages.parquet")
AT_A_TIME: Final = 2
"""Runs in virtual time."""
TRIES: Final = 2
"""Of a run as processes, if the machine does not keep up."""
HOST_LATE: Final = "not comparable (host late)"


class RunError(Exception):
    """A run failed; says why."""


class HostLateError(Exception):
    """The machine did not keep up with a run as processes."""


# --- runs -------------------------------------------------------------------------------------------------------------


@dataclass
class Commands:
    """Programs that end when this one does."""

    _lock: Lock = field(default_factory=Lock)
    _running: set[subprocess.Popen[str]] = field(default_factory=set)
    _over: bool = False

    def run(self, command: Sequence[str], folder: Path) -> tuple[int, str]:
        """Run it in a folder, whose code comes first: its exit code, and what it said on stderr."""
        environment = {**os.environ, "PYTHONPATH": str(folder), "OPENBLAS_NUM_THREADS": "1"}
        with self._lock:
            if self._over:
                raise RunError("ended early")
            child = subprocess.Popen(
                command, cwd=folder, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
            )
            self._running.add(child)
        said = child.communicate()[1]
        self._running.discard(child)
        return child.returncode, said

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """End those that run, and start no other."""
        with self._lock:
            self._over = True
            left = list(self._running)
        for child in left:
            child.terminate()
        for child in left:
            child.wait()


@dataclass(frozen=True)
class Version:
    """The code of a version, and the folder of its finished runs, one for each case and its arguments."""

    name: str
    code: Path
    runs: Path
    commands: Commands

    def run(self, case: Case) -> Path:
        """The folder with the tables of a run, perhaps an earlier one. Raises ``RunError`` or ``HostLateError``."""
        key = blake2b("\0".join(case.arguments).encode(), digest_size=6).hexdigest()
        folder = self.runs / f"{case.name}-{key}"
        for _ in range(TRIES):
            if folder.is_dir() or self._ran(case, folder):
                return folder
        raise HostLateError

    def _ran(self, case: Case, folder: Path) -> bool:
        """Whether the machine kept up; only then the folder is there."""
        part = folder.with_suffix(".part")
        shutil.rmtree(part, ignore_errors=True)
        command = [sys.executable, "-m", "launcher.cli", "run", *case.arguments, "--quiet", "--out", str(part)]
        code, said = self.commands.run(command, self.code)
        if case.processes and (part / METRICS).exists() and not kept_up(json.loads((part / METRICS).read_text())):
            return False
        if code:
            raise RunError(f"the {self.name} version: exit code {code}, {(said.strip() or 'no word').splitlines()[-1]}")
        for entry in part.iterdir():
            if entry.is_dir():
                shutil.rmtree(entry)
            elif entry.name not in (*TABLES, METRICS):
                entry.unlink()
        part.rename(folder)
        return True


def compared(case: Case, old: Version, new: Version) -> tuple[str, str]:
    """The verdict on a case, a word or two, and what more there is to say."""
    try:
        runs = [version.run(case) for version in (old, new)]
    except RunError as error:
        return "failed", str(error)
    except HostLateError:
        return HOST_LATE, ""
    tracks, messages = ([pq.read_table(run / name) for run in runs] for name in TABLES)
    shutil.rmtree(runs[1])
    values, frames = differences(*tracks, *messages)
    if values or frames:
        return "differ", f"{len(values)} values, {len(frames)} frames; the first: {(values or frames)[0]}"
    return "same", f"{tracks[0].num_rows} points, {messages[0].num_rows} frames"


# --- all cases --------------------------------------------------------------------------------------------------------


@contextmanager
def checked_out(commit: str, folder: Path) -> Iterator[Path]:
    """The files of a commit, for a while."""
    git("worktree", "add", "--detach", "--quiet", str(folder), commit)
    try:
        yield folder
    finally:
        git("worktree", "remove", "--force", str(folder))


def git(*arguments: str) -> str:
    """What git says. Raises ``CalledProcessError`` if it fails."""
    return subprocess.run(["git", *arguments], cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout.strip()


def same_as(commit: str, chosen: Sequence[Case], keep: Path | None) -> Counter[str]:
    """Say the verdict on each case; how many there are of each. Runs as processes have the machine to themselves."""
    count = Counter[str]()
    with (
        tempfile.TemporaryDirectory(prefix="same-as-") as scratch,
        checked_out(commit, Path(scratch) / "code") as code,
        ThreadPoolExecutor(AT_A_TIME) as pool,
        Commands() as commands,
    ):
        folders = (keep.resolve() if keep else Path(scratch)) / commit, Path(scratch) / "new"
        for folder in folders:
            folder.mkdir(parents=True, exist_ok=True)
        old, new = Version("old", code, folders[0], commands), Version("new", ROOT, folders[1], commands)
        virtual, processes = ([case for case in chosen if case.processes == kind] for kind in (False, True))
        judge = partial(compared, old=old, new=new)
        for case, (verdict, more) in zip(
            [*virtual, *processes], chain(pool.map(judge, virtual), map(judge, processes)), strict=True
        ):
            count[verdict] += 1
            print(f"{case.name}: {verdict}{more and f' ({more})'}", flush=True)
    return count


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("commit", metavar="COMMIT", help="the earlier version")
    parser.add_argument("--only", default="", metavar="TEXT", help="the cases whose name contains it")
    parser.add_argument("--no-processes", action="store_true", help="runs in virtual time alone")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="where its runs stay, to be used again next time")
    asked = parser.parse_args()
    try:
        commit = git("rev-parse", "--verify", "--quiet", f"{asked.commit}^{{commit}}")
    except subprocess.CalledProcessError:
        parser.error(f"there is no commit {asked.commit!r}; expected one that git log shows")
    chosen = [case for case in cases() if asked.only in case.name and not (asked.no_processes and case.processes)]
    if not chosen:
        parser.error(f"no case has {asked.only!r} in its name; expected a part of one, like spcpf-s1-faults-3")
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    begun = time.monotonic()
    try:
        count = same_as(commit, chosen, asked.keep)
    except KeyboardInterrupt:
        print(f"ended early, after {time.monotonic() - begun:.0f} s", file=sys.stderr)
        return 130
    said = ", ".join(f"{number} {verdict}" for verdict, number in sorted(count.items(), reverse=True))
    print(f"all in {time.monotonic() - begun:.0f} s: {said}")
    return int(count["same"] < len(chosen))


if __name__ == "__main__":
    sys.exit(main())
