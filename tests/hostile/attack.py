"""One attacked run: the command line, a peer beside it, and what came of both."""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import psutil

from tests.hostile import field
from tests.hostile.peer import Peer
from tests.hostile.samples import REFUSED, Bad
from tests.hostile.verdicts import Attacked, complaints
from tests.running import METRICS, Run, leftovers, until

SPEEDS: Final = (field.SPEED, 2.0, 1.5, 0.5)
"""If the machine cannot keep up with one, the next; a frame without an envelope is one of the field at speed 1."""


@dataclass(frozen=True)
class Attack:
    """A mix of bad samples: ``rate`` of them a second, with these draws, on the run of this scenario's seed."""

    mix: Sequence[Bad]
    seed: int
    scenario_seed: int = 1
    rate: float = 100.0


@dataclass(frozen=True)
class Result:
    """What came of an attack: what was put, and what does not hold."""

    put: Counter[str]
    total: int
    wrong: list[str]
    run: Attacked | None = None


def attacked(attack: Attack, home: Path, also: Callable[[Run, Peer], None] = lambda _run, _peer: None) -> Result:
    """Attack a run in folders below ``home``; ``also`` is called once the peer is there.

    If the machine does not keep up, the run is repeated at a lower speed.
    """
    for speed in SPEEDS:
        shutil.rmtree(home / "run", ignore_errors=True)
        result = _once(attack, home / "run", speed, also)
        if not result.wrong or result.run is None or result.run.kept_up:
            break
    return result


def _once(attack: Attack, folder: Path, speed: float, also: Callable[[Run, Peer], None]) -> Result:
    plan = field.plan_of(attack.scenario_seed)
    harmful = any(REFUSED not in bad.follows for bad in attack.mix)
    run = Run(folder, *field.arguments(attack.scenario_seed), "--speed", str(speed))
    try:
        manifest = until(run.manifest)
        with Peer(
            manifest["endpoint"],
            manifest["run"],
            field.known_of(plan),
            attack.mix,
            seed=attack.seed,
            speed=speed,
            end_ns=plan.run.end_ns,
            rate=attack.rate,
        ) as peer:
            also(run, peer)
            family = list(run.family().values())
            code, said = run.finish()
    except Exception as error:  # noqa: BLE001  whatever it is, the run did not end as it should
        ended(run)
        return Result(Counter(), 0, [f"{type(error).__name__}: {error}; it said: {run.said()[-500:]}"])
    wrong = [f"left behind: {left}" for left in leftovers(family)]
    if not (folder / METRICS).exists():
        return Result(peer.put, peer.total, [*wrong, f"no {METRICS}; exit code {code}: {said[-700:]}"])
    found = Attacked(attack.scenario_seed, folder, code, said, run.metrics(), peer.alarming, harmful)
    return Result(peer.put, peer.total, [*wrong, *complaints(found)], found)


def ended(run: Run) -> None:
    """End a run that hangs, with all its processes."""
    with_children = [psutil.Process(run.process.pid), *run.family().values()] if run.process.poll() is None else []
    for process in with_children:
        try:
            process.kill()
        except psutil.Error:
            continue
    run.process.wait(30)
