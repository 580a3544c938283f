"""The cost of a command from the shell's prompt to the next one: starting Python, loading, and the work itself.

    python -m bench.start --rounds 10

Each command is a process of its own; they take turns. Prints a table: wall and processor time (that of the report's
processes included), each the least of all rounds, and wall time over that of a Python that does nothing.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

NOTHING: Final = "python -c pass"
COMMANDS: Final[Mapping[str, tuple[str, ...]]] = {
    "trackfield --help": ("--help",),
    "trackfield list": ("list",),
    "trackfield run --help": ("run", "--help"),
    "trackfield validate zhai-spcpf": ("validate", "zhai-spcpf"),
    "trackfield run zhai-spcpf --virtual": ("run", "zhai-spcpf", "--virtual", "--quiet"),
}

Cost = tuple[float, float]
"""Wall and processor time, in s."""


def measure(rounds: int, commands: Mapping[str, tuple[str, ...]] = COMMANDS) -> dict[str, Cost]:
    """The least cost of each command over ``rounds`` rounds, and of a Python that does nothing."""
    every = {NOTHING: ("-c", "pass"), **{name: ("-m", "launcher.cli", *rest) for name, rest in commands.items()}}
    found: dict[str, list[Cost]] = {name: [] for name in every}
    for _ in range(rounds):
        for name, arguments in every.items():
            found[name].append(_cost(arguments))
    return {name: (min(wall for wall, _ in costs), min(cpu for _, cpu in costs)) for name, costs in found.items()}


def _cost(arguments: Sequence[str]) -> Cost:
    """The cost of one process, in an empty working directory."""
    path = os.pathsep.join([str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", "")])
    with tempfile.TemporaryDirectory() as folder:
        before, begun = _children_s(), time.perf_counter()
        subprocess.run(
            [sys.executable, *arguments],
            check=True,
            cwd=folder,
            env={**os.environ, "PYTHONPATH": path},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        return time.perf_counter() - begun, _children_s() - before


def _children_s() -> float:
    """Processor time of all children so far that have ended, and of theirs."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def table(found: Mapping[str, Cost]) -> str:
    """The costs as Markdown."""
    return "\n".join(_lines(found))


def _lines(found: Mapping[str, Cost]) -> Iterator[str]:
    yield "| command | wall s | CPU s | wall / nothing |"
    yield "| --- | ---: | ---: | ---: |"
    nothing, _ = found[NOTHING]
    for name, (wall, cpu) in found.items():
        yield f"| `{name}` | {wall:.2f} | {cpu:.2f} | {wall / nothing:.0f} |"


def main() -> None:
    """See the module's docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=10)
    print(table(measure(parser.parse_args().rounds)))


if __name__ == "__main__":
    main()
