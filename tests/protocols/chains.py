"""What all of the protocols have in common: chains that are published every step, and kept for a next life."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Final

from tests.toys import MODULUS
from trackfield.draw import bits
from trackfield.drivers.spec import ProcessSpec, RunSpec, places_of
from trackfield.role import NS, Publish, SetTimer, Started, Store, TrackPoint
from trackfield.wire.registry import Scaled

MS: Final = 1_000_000
Chain = Annotated[int, Scaled(0, MODULUS)]
Count = Annotated[int, Scaled(0, 2**32 - 1)]


def next_step(now: int) -> SetTimer:
    """The timer of the next whole second of the own clock."""
    return SetTimer("step", (now // NS + 1) * NS)


def told(name: str, now: int, chain: int) -> Publish:
    """The chain at a step, as a track, which is compared to the last bit."""
    step = now // NS
    return Publish(TrackPoint(name, "t", step * NS, "tracking", (float(chain), 0.0, 0.0, 0.0), (0.0,) * 16, step=step))


def kept(*numbers: int) -> Store:
    """Numbers for the next life."""
    return Store(" ".join(map(str, numbers)).encode())


def known(event: Started, *default: int) -> tuple[int, ...]:
    """The numbers that an earlier life kept; the default if there was none."""
    return tuple(map(int, event.stored.split())) if event.stored else default


def run_of(protocol: str, seed: int, seconds: int, loss: float, speed: float) -> RunSpec:
    """A run whose frames take 2 to 6 ms, as the seed says: no more than a host may take."""
    link = {"model": "fixed", "loss": loss, "delay_ms": 2.0 + bits(seed, "delay") % 4000 / 1000}
    return RunSpec(f"{protocol}-{seed}", seed, seconds * NS, link, speed)


def acquainted(processes: Sequence[ProcessSpec]) -> list[ProcessSpec]:
    """The processes, each a peer of all others."""
    return [replace(p, peers=places_of(other for other in processes if other.id != p.id)) for p in processes]
