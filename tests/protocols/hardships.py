"""What may befall the processes of a party: clocks that are off, freezes, kills, next lives, batteries, cuts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from random import Random
from typing import Any, Final

from tests.mortals import lived
from tests.protocols.chains import MS
from tests.protocols.parties import PARTIES, Party
from trackfield.drivers.spec import ProcessSpec
from trackfield.role import NS

POWER: Final[dict[str, Any]] = {"send_uw": 58_200, "receive_uw": 62_400, "listen_uw": 62_400, "sleep_uw": 7_400}


def frozen(process: ProcessSpec, draw: Random, end_ns: int) -> list[ProcessSpec]:
    """It does nothing for a while."""
    begin = draw.randrange(NS, end_ns - NS)
    return [replace(process, freezes=((begin, begin + draw.randrange(1, 2 * NS)),))]


def killed(process: ProcessSpec, draw: Random, end_ns: int) -> list[ProcessSpec]:
    """It dies late, and stays dead."""
    return [replace(process, kill_ns=draw.randrange(end_ns // 2, end_ns))]


def restarted(process: ProcessSpec, draw: Random, end_ns: int) -> list[ProcessSpec]:
    """It lives two or three times; it may be dead in between."""
    cuts = sorted(draw.sample(range(NS, end_ns, 500 * MS), draw.choice([2, 4])))
    cuts = [at + draw.randrange(499 * MS) for at in cuts]
    if draw.random() < 0.3:
        cuts[1] = cuts[0]
    ends = [*cuts[::2], None]
    return lived(process, *zip([0, *cuts[1::2]], ends, strict=True))


def emptied(process: ProcessSpec, draw: Random, end_ns: int) -> list[ProcessSpec]:
    """Its battery is empty before the end, about when it is if its radio only listens."""
    until = draw.randrange(end_ns // 3, end_ns * 9 // 10)
    return [replace(process, power={**POWER, "battery_fj": POWER["listen_uw"] * until})]


def jumped(process: ProcessSpec, draw: Random, end_ns: int) -> list[ProcessSpec]:
    """Its clock is put forward, and later back."""
    first, second = sorted(draw.sample(range(NS, end_ns), 2))
    return [replace(process, jumps=((first, draw.randrange(NS)), (second, -draw.randrange(2 * NS))))]


DEEDS: Final[dict[str, Callable[[ProcessSpec, Random, int], list[ProcessSpec]]]] = {
    "restart": restarted,
    "freeze": frozen,
    "battery": emptied,
    "clock_jump": jumped,
    "kill": killed,
}


def off(process: ProcessSpec, draw: Random) -> ProcessSpec:
    """A process whose clock is up to 30 ms off, and drifts."""
    clock = {
        "offset_ns": draw.randint(-30 * MS, 30 * MS),
        "drift_ppb": draw.randint(-50_000, 50_000),
        "ramp_ppb_per_h": draw.choice([0, 100_000]),
    }
    return replace(process, clock=clock, power=POWER)


def befallen(party: Party, draw: Random, deeds: Sequence[str]) -> Party:
    """The party with a deed for each of so many of its processes."""
    run, processes = party
    struck = dict(zip(draw.sample([p.id for p in processes], len(processes)), deeds, strict=False))
    lives: list[ProcessSpec] = []
    for process in processes:
        deed = struck.get(process.id)
        lives += DEEDS[deed](process, draw, run.end_ns) if deed else [process]
    return run, lives


def cut(party: Party, draw: Random) -> Party:
    """The party with half of it cut off from the rest for a while."""
    run, processes = party
    ids = sorted({p.id for p in processes})
    begin = draw.randrange(NS, run.end_ns - NS)
    away = tuple(draw.sample(ids, len(ids) // 2))
    return replace(run, partitions=((begin, begin + draw.randrange(NS, 3 * NS), away, None),)), processes


def hard(protocol: str, seed: int, **options: Any) -> Party:
    """A party whose clocks are off and of whom more than half are struck; it is cut in two for a while."""
    draw = Random(f"hardships of {protocol} {seed}")
    naps = {"naps": True} if protocol == "election" else {}
    run, processes = PARTIES[protocol](seed, **naps, **options)
    deeds = draw.sample(list(DEEDS), min(len(processes) // 2 + 1, len(DEEDS)))
    return cut(befallen((run, [off(process, draw) for process in processes]), draw, deeds), draw)
