"""What is said of a field in which any node may lead, before it runs: in figures, and as warnings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from launcher.plan.forecast.heads.polled import Polled

POOR: Final = 0.5
"""A base that hears less than this share of what a head says is out of its reach."""
FEW: Final = 0.05
"""What holds in a smaller share of the steps is no warning."""


def who_is_polled(field: Polled) -> Iterator[str]:
    """Who leads, how many are polled, and what arrives; a line each."""
    turns = list(field.turns.values())
    if not turns:
        yield "heads: no sensor has a target in reach, so nobody leads"
        return
    polled, sensed = (float(np.mean([len(one) for one in each])) for each in _both(field))
    elections = sum(bool(turn.contenders) for turn in turns)
    handed = sum(bool(turn.heir) for turn in turns)
    times = f", {_count(elections, 'election')}, {_count(handed, 'hand-over')}" if field.every == 1 else ""
    yield (
        f"heads: from step {turns[0].step} on {polled:.1f} sensors are polled in a step, the head among them if it is "
        f"one, and {sensed:.1f} of them have a target in reach{times}"
    )
    told = field.told
    worst = min(told, key=lambda step: told[step])
    how = "over the tree" if field.schedule.always_on else "directly"
    yield (
        f"base: {field.schedule.base} hears {np.mean([*told.values()]):.1%} of what heads tell it {how} "
        f"(worst: {field.turns[worst].leader}, {told[worst]:.1%})"
    )


def _both(field: Polled) -> tuple[list[Sequence[str]], list[Sequence[str]]]:
    turns = field.turns.values()
    return [turn.polled for turn in turns], [tuple(turn.sensed) for turn in turns]


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'s' * (number != 1)}"


# --- warnings ---------------------------------------------------------------------------------------------------------


def astray(field: Polled) -> Iterator[str]:
    """What is likely to go wrong because nodes lead."""
    if not field.turns:
        return
    yield from _several(field)
    yield from _base(field)
    yield from _beyond(field)
    yield from _handed(field)


def _several(field: Polled) -> Iterator[str]:
    if len(field.plan.paths) > 1:
        yield (
            f"there are {len(field.plan.paths)} targets, and a head follows one; those who sense another and hear a "
            "head start no election: what is predicted is of the first target"
        )


def _base(field: Polled) -> Iterator[str]:
    """Steps at which the base hears little of the head."""
    told = field.told
    poor = [step for step, share in told.items() if share < POOR]
    if len(poor) < FEW * len(told):
        return
    worst = min(poor, key=lambda step: told[step])
    base = field.schedule.base
    remedy = "more power" if field.schedule.always_on else "more power, or a tree (architecture.multihop)"
    yield (
        f"the path leaves the reach of {base}: in {_steps(field, len(poor))} less than {POOR:.0%} of what the head "
        f"says arrives there (worst: {field.turns[worst].leader}, {told[worst]:.0%}); the track in the network is the "
        f"headline, that of the base has gaps; move the base (fusion.x_m, fusion.y_m), or use {remedy}"
    )


def _beyond(field: Polled) -> Iterator[str]:
    """Steps at which the head cannot poll the nearest."""
    far = [turn for turn in field.turns.values() if turn.beyond]
    if len(far) < FEW * len(field.turns):
        return
    most = max(far, key=lambda turn: len(turn.beyond))
    reach = [len(field.heads.peers(turn.leader)) for turn in far]
    known = [len(field.heads.close(turn.leader)) for turn in far]
    yield (
        f"the best sensors are out of the head's reach in {_steps(field, len(far))}: nearer to the target than "
        f"one that it polls, and it hears less than half of what they announce (step {most.step}: {most.leader} cannot "
        f"poll {', '.join(most.beyond[:3])}); such a head reaches {np.mean(reach):.1f} of {np.mean(known):.1f} sensors "
        f"within {field.schedule.peers_m:g} m; use more power"
    )


def _handed(field: Polled) -> Iterator[str]:
    """Hand-overs that are mostly lost."""
    shares = field.receptions.get("hand-over", {})
    poor = [link for link, share in shares.items() if share < POOR]
    if poor and len(poor) >= FEW * len(shares):
        worst = min(poor, key=lambda link: shares[link])
        yield (
            f"less than {POOR:.0%} of the hand-overs arrive on {len(poor)} of {_count(len(shares), 'link')} (worst: "
            f"{' to '.join(worst)}, {shares[worst]:.0%}), of {field.sizes['hand-over']} bytes each; use more power, or "
            "architecture.handover = 'gaussian'"
        )


def _steps(field: Polled, number: int) -> str:
    """Of those at which somebody leads."""
    about = "about " if field.every > 1 else ""
    return f"{about}{number * field.every} of {len(field.turns) * field.every} steps with a head"
