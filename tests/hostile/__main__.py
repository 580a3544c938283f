"""The campaign of hostile peers: small real runs with a peer at their router that attacks from the first moment on.

    python -m tests.hostile [--runs 40] [--seed 1] [--direct 100000]
    python -m tests.hostile --secure [--runs 40] [--seed 1]

Each seed draws a mix of bad samples (``frames``, ``orders``, ``tellings``), how many come a second, and the run that is
attacked. Every second mix has only samples that must not change anything: tracks and frames are compared with those of
the undisturbed run, bit for bit. A seed that fails is printed as the command that repeats it. ``--direct`` samples are
given to a recorder, a process and a launcher without a router, too, which is faster.

With ``--secure`` the runs are secured, and the peer shows in turn no certificate, one of a forged authority, an expired
one, one of another run, and that of a node. With this it does all that the suite knows, or, every second time, only
what is not in the node's own name.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

from launcher.security.attempts import NOBODY
from tests.hostile import secured
from tests.hostile.attack import Result, attacked
from tests.hostile.direct import feed
from tests.hostile.mixes import HARMLESS, OTHERS, PLANES, attack, of_planes
from tests.hostile.papers import Shown


def result(seed: int) -> Result:
    """What came of the attack of a seed."""
    with tempfile.TemporaryDirectory() as scratch:
        return attacked(attack(seed), Path(scratch))


def campaign(seeds: range, *, direct: int, say: Callable[[str], object] = print) -> int:
    """The exit code: 1 if any seed fails."""
    begun, failed, put, total = time.monotonic(), 0, Counter[str](), 0
    for seed in seeds:
        came = result(seed)
        put, total = put + came.put, total + came.total
        if came.wrong:
            failed += 1
            say(f"seed {seed} fails: python -m tests.hostile --runs 1 --seed {seed} --direct 0")
            for what in came.wrong[:5]:
                say("  " + what.replace("\n", "\n  "))
    for found in feed(seeds.start, direct):
        failed += 1
        say(found)
    for line in table(put):
        say(line)
    said = f"{len(seeds)} runs, {total} bad samples, {direct} more without a router"
    say(f"{said}, in {time.monotonic() - begun:.0f} s: {failed} failed")
    return int(failed > 0)


def table(put: Counter[str]) -> list[str]:
    """What was put while the runs went on, by plane."""
    lines = ["| plane | samples | what was tried |", "| --- | --- | --- |"]
    kinds = of_planes()
    for plane in PLANES:
        tried = ", ".join(f"{bad.what} {put[bad.what]}" for bad in kinds[plane])
        lines.append(f"| {plane} | {sum(put[bad.what] for bad in kinds[plane])} | {tried} |")
    return lines


def secured_campaign(seeds: range, *, say: Callable[[str], object] = print) -> int:
    """The same of secured runs."""
    begun, failed = time.monotonic(), 0
    lines = {shown: Line() for shown in Shown}
    for seed in seeds:
        shown = list(Shown)[seed % len(Shown)]
        with tempfile.TemporaryDirectory() as scratch:
            drawn = replace(attack(seed), mix=(*HARMLESS, *OTHERS))
            came = secured.attacked(drawn, shown, Path(scratch), pretend=seed % 2 == 0)
        lines[shown].add(came)
        if came.wrong:
            failed += 1
            say(f"seed {seed} fails: python -m tests.hostile --secure --runs 1 --seed {seed}")
            for what in came.wrong[:5]:
                say("  " + what.replace("\n", "\n  "))
    say("| the peer shows | runs | noticed in | connections refused | in the node's own name | refused |")
    say("| --- | --- | --- | --- | --- | --- |")
    for shown, line in lines.items():
        counts = f"{line.runs} | {line.noticed} | {line.connections} | {line.own}"
        say(f"| {shown.value} | {counts} | {told(line.refused)} |")
    say(f"{len(seeds)} secured runs, in {time.monotonic() - begun:.0f} s: {failed} failed")
    return int(failed > 0)


@dataclass
class Line:
    """What came of all attacks with one kind of certificate."""

    runs: int = 0
    connections: int = 0
    refused: Counter[str] = field(default_factory=Counter)
    own: int = 0
    noticed: int = 0

    def add(self, came: secured.Secured) -> None:
        self.runs += 1
        self.connections += sum(came.attempts.get(NOBODY, {}).values())
        for name, kinds in came.attempts.items():
            if name != NOBODY:
                self.refused.update(kinds)
        self.own += came.allowed.total()
        self.noticed += came.run is not None and came.run.code == 1


def told(counts: Counter[str]) -> str:
    """How often each, in their order."""
    return ", ".join(f"{what} {counts[what]}" for what in sorted(counts)) or "0"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1, help="of the first run")
    parser.add_argument(
        "--direct", type=int, default=100_000, help="samples that are given to parsers without a router"
    )
    parser.add_argument("--secure", action="store_true", help="attack secured runs")
    asked = parser.parse_args()
    if asked.secure:
        return secured_campaign(range(asked.seed, asked.seed + asked.runs))
    return campaign(range(asked.seed, asked.seed + asked.runs), direct=asked.direct)


if __name__ == "__main__":
    sys.exit(main())
