"""Recordings to look at: whole ones, and what can be read of one whose recorder was killed or still writes."""

from __future__ import annotations

import contextlib
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from launcher.files import recovering
from launcher.timeline.look import TIME
from launcher.timeline.program import environment, program
from trackfield.errors import ScenarioError

MAGIC: Final = b"RRF2"
"""How a Rerun file begins."""
END: Final = b"RRF2FOOT"
"""How the last ``END_BYTES`` of a file begin that was closed."""
END_BYTES: Final = len(END) + 4
CHECK_S: Final = 120.0
"""How long Rerun's program may take to read a file once."""
A_TIMELINE: Final = "the run.rrd of a run"


def timeline_of(run: Path) -> Path:
    """The recording of a run folder, or the recording itself if a file is given, as ``compare --rrd`` writes it."""
    try:
        file = run if run.suffix == ".rrd" and run.is_file() else run / "run.rrd"
        if not file.is_file():
            expected = "the folder of a run, with run.rrd in it"
            raise ScenarioError("has no timeline", file=str(run), expected=expected + recovering(run))
        with file.open("rb") as begun:
            magic = begun.read(len(MAGIC))
    except OSError as error:
        raise ScenarioError(f"cannot be read ({error.strerror})", file=str(run), expected=A_TIMELINE) from None
    if magic != MAGIC:
        raise ScenarioError("is not a timeline", file=str(file), expected=A_TIMELINE)
    return file.resolve()


@contextlib.contextmanager
def whole(run: Path) -> Iterator[Path]:
    """The file of this run to show: its own, or if that has no end, a repaired copy, which goes with the context.

    Raises ``ScenarioError`` if there is nothing in it to show.
    """
    file = timeline_of(run)
    if _verified(file):
        _check(file, file)
        yield file
        return
    with tempfile.TemporaryDirectory(prefix="trackfield-") as folder:
        repaired = Path(folder) / file.name
        if _call("merge", "--continue-on-error", "-o", str(repaired), str(file)) is None:
            long = f"has no end, and what is there could not be read within {CHECK_S:g} s"
            raise ScenarioError(long, file=str(file), expected=A_TIMELINE + recovering(file.parent))
        _check(repaired, file)
        said = f"note: {file} has no end, as its recorder still writes or was killed: this is what is there"
        print(said, file=sys.stderr)
        yield repaired


def _verified(file: Path) -> bool:
    """Whether it has an end, and Rerun can read all of it, or as much as it can within ``CHECK_S``."""
    with file.open("rb") as stream:
        stream.seek(max(file.stat().st_size - END_BYTES, 0))
        ended = stream.read().startswith(END)
    return ended and _call("verify", str(file)) in (0, None)


def _call(*arguments: str) -> int | None:
    """Rerun's program at work on a file; its exit code (None: it took longer than ``CHECK_S``)."""
    command = [str(program()), "rrd", *arguments]
    try:
        return subprocess.run(command, env=environment(), capture_output=True, check=False, timeout=CHECK_S).returncode
    except subprocess.TimeoutExpired:
        return None


def _check(file: Path, named: Path) -> None:
    """Raise ``ScenarioError`` unless something happens in this recording, by its end: the rest of it is not read."""
    from rerun.chunk import RrdReader

    try:
        times = {column.name for column in RrdReader(file).store().schema().index_columns()}
    except (OSError, ValueError, RuntimeError):
        times = set()
    if TIME not in times:
        torn = "is damaged, or ends before anything happened"
        raise ScenarioError(torn, file=str(named), expected=A_TIMELINE + recovering(named.parent))
