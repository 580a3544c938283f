"""Run folders with damaged files, read by every command: each answers as ever, or with one message and exit code 2.

    python -m tests.damaged_runs [--tries 300] [--seed 1] [--pictures]

Each seed draws which file is damaged, how, and which command reads the folder; with ``--pictures`` also ``view``, which
starts a viewer. A seed that fails is printed as the command that repeats it.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any, Final
from unittest.mock import patch

import trackfield as tf
from launcher import cli
from tests.damages import spoil
from trackfield.errors import ScenarioError

LIMIT_S: Final = 60
"""A command that takes longer hangs."""
RUN_FILES: Final = ("metrics.json", "manifest.json", "scenario.toml", "messages.parquet", "tracks.parquet")
SHORT: Final = ("--virtual", "--quiet", "--nodes", "9", "--set", "target.steps=5")
LOSSY: Final = ("--set", "link.model=fixed", "--set", "link.loss=0.2", "--set", "energy.battery_j=0.05")
STUDY: Final = ("study", "zhai-spcpf", "--seeds", "1", "--vary", "link.loss=0,0.3", "--jobs", "1", "--out", "study")


@dataclass(frozen=True)
class Ended:
    """How a command ended: its exit code, or what escaped from it, and what it said."""

    code: int
    out: str
    err: str
    escaped: str = ""


class Hung(BaseException):
    """A command took longer than it may."""


# --- commands ---------------------------------------------------------------------------------------------------------


def called(*arguments: str) -> Ended:
    """``trackfield`` with these arguments, in this process."""
    with patch.object(sys, "argv", ["trackfield", *arguments]):
        return ended(cli.main)


def ended(call: Callable[[], object]) -> Ended:
    """How a call ends; a ``ScenarioError`` is what it is for the command line."""
    out, err = io.StringIO(), io.StringIO()
    code, escaped = 0, ""
    before = signal.signal(signal.SIGALRM, _hung)
    signal.alarm(LIMIT_S)
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            call()
    except SystemExit as end:
        code = int(end.code or 0)
    except ScenarioError as error:
        code = 2
        err.write(f"trackfield: {error}\n")
    except BaseException:  # noqa: BLE001  whatever escapes is the failure
        escaped = traceback.format_exc()
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
    return Ended(code, out.getvalue(), err.getvalue(), escaped)


def _hung(*_: object) -> None:
    raise Hung


def in_python() -> None:
    """What ``import trackfield`` offers for a run."""
    run = tf.open("bad")
    _ = run.metrics, len(run.tracks), len(run.messages)
    run._repr_html_()
    run.plot()


def compared_in_python() -> None:
    """Two runs in Python."""
    both = tf.compare(["good", "bad"])
    _ = both.table, repr(both), both.to_html()


def latest() -> None:
    """The newest run below runs/, of which one is damaged."""
    Path("runs").mkdir(exist_ok=True)
    for name in ("good", "bad"):
        if not (Path("runs") / name).exists():
            (Path("runs") / name).symlink_to(Path(name).absolute())
    called("report", "latest")
    cli_run = tf.open("latest")
    _ = cli_run.metrics


COMMANDS: Final[dict[str, Callable[[], Ended]]] = {
    "report": lambda: called("report", "bad"),
    "compare": lambda: called("compare", "good", "bad"),
    "compare --json": lambda: called("compare", "bad", "good", "--json"),
    "compare --exact": lambda: called("compare", "good", "bad", "--exact", "0"),
    "compare --html": lambda: called("compare", "good", "bad", "--html", "c.html", "--csv", "c.csv", "--rrd", "c.rrd"),
    "replay": lambda: called("replay", "bad", "--out", "again"),
    "replay --tracker": lambda: called("replay", "bad", "--tracker", "ekf", "--drop-late", "--out", "again", "--json"),
    "open": lambda: ended(in_python),
    "tf.compare": lambda: ended(compared_in_python),
    "latest": lambda: ended(latest),
    "study": lambda: called(*STUDY),
}
WEIGHTS: Final = {"report": 6, "compare --json": 4, "replay": 4, "open": 3, "study": 1}
"""Which commands are drawn more often than others, which count 2."""


# --- tries ------------------------------------------------------------------------------------------------------------


def make_runs(home: Path) -> None:
    """Two short runs and a study below this folder."""
    with contextlib.chdir(home):
        for name, more in (("good", LOSSY), ("other", ("--seed", "5"))):
            assert called("run", "zhai-spcpf", *SHORT, *more, "--out", name).code == 0
            _always_the_same(Path(name))
        made = called(*STUDY)
        assert made.code == 0, made


def _always_the_same(run: Path) -> None:
    """Without what differs each time, so that a seed draws the same damage again."""
    for file, same in (("metrics.json", {"wall_s": 1.0, "cpu_s": 1.0}), ("manifest.json", {"run": "same"})):
        whole = json.loads((run / file).read_text())
        (run / file).write_text(json.dumps({**whole, **same}, indent=2))


def attempt(home: Path, seed: int, *, pictures: bool = False) -> tuple[str, Ended]:
    """What was damaged and which command read it, and how that ended; ``home`` has what ``make_runs`` made."""
    draw = Random(seed)
    names = [*COMMANDS, *(["view"] if pictures else [])]
    name = draw.choices(names, [WEIGHTS.get(one, 2) for one in names])[0]
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        shutil.copytree(home / "good", work / "good")
        shutil.copytree(home / "good", work / "bad")
        with contextlib.chdir(work):
            if name == "study":
                shutil.copytree(home / "study", work / "study")
                files = sorted([*work.glob("study/results/*/*.parquet"), work / "study" / "manifest.json"])
                file = draw.choice(files)
                others = [one for one in files[:-1] if one != file]
                done = spoil(draw, file, others[0] if file.suffix == ".parquet" else home / "other" / file.name)
            else:
                file = work / "bad" / ("run.rrd" if name == "view" else draw.choice(RUN_FILES))
                done = spoil(draw, file, home / "other" / file.name)
            end = called("view", "bad", "--png", "a.png") if name == "view" else COMMANDS[name]()
    return f"{name}, {done}", end


def wrong(end: Ended, done: str = "") -> str:
    """What is wrong with how a command ended, or nothing; only ``compare --exact`` may end with 1, for other tracks."""
    if end.escaped:
        return end.escaped
    if "Traceback" in end.err or "Traceback" in end.out:
        return f"a traceback: {end.err}"
    if any(not (c.isprintable() or c == "\n") for c in end.err):
        return f"control characters: {end.err!r}"
    if end.code == 2:
        lines = end.err.strip().splitlines()
        told = [line for line in lines if line.startswith("trackfield: ")]
        return "" if len(told) == 1 and max(map(len, lines)) < 1000 else f"not one message: {end.err!r:.3000}"
    return (
        ""
        if end.code == 0 or (end.code == 1 and done.startswith("compare --exact"))
        else f"exit code {end.code}: {end.err}"
    )


def tried(home: Path, seeds: Sequence[int], *, pictures: bool = False) -> Iterator[tuple[int, str, Ended, str]]:
    """(seed, what was done, how it ended, what is wrong with that) of each."""
    for seed in seeds:
        done, end = attempt(home, seed, pictures=pictures)
        yield seed, done, end, wrong(end, done)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tries", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--pictures", action="store_true")
    asked = parser.parse_args()
    begun, codes, failed = time.monotonic(), Counter[Any](), 0
    with tempfile.TemporaryDirectory() as folder:
        make_runs(Path(folder))
        for seed, done, end, bad in tried(
            Path(folder), range(asked.seed, asked.seed + asked.tries), pictures=asked.pictures
        ):
            codes[end.code] += 1
            if bad:
                failed += 1
                again = f"python -m tests.damaged_runs --tries 1 --seed {seed}{' --pictures' * asked.pictures}"
                print(f"{again}\n    {done}\n    {bad.strip()}\n", flush=True)
            elif asked.tries == 1:
                print(f"{done}\n    exit code {end.code}: {end.err.strip()}")
    ends = ", ".join(f"{n} with exit code {code}" for code, n in sorted(codes.items()))
    print(f"{asked.tries} tries in {time.monotonic() - begun:.0f} s: {ends}; {failed} failed")
    return min(failed, 1)


if __name__ == "__main__":
    raise SystemExit(main())
