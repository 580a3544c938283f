"""Nodes of which any may lead: who led when, how heads were elected, and how much the others sleep."""

from __future__ import annotations

from typing import Any, Final

from matplotlib.figure import Figure

from launcher.record.figures.elections import Election
from launcher.record.words import span
from launcher.report.cells import NOTHING, Table, ids, number, percent
from launcher.report.folder import Run
from launcher.report.leading import peers, turn_lines, who_led
from launcher.report.led import Led, read_led, seconds
from launcher.report.parts.machine import Line
from launcher.report.style import Figures
from trackfield.role import NS

MOST_ELECTIONS: Final = 30
"""Of more elections the first ones are listed."""


def contents(run: Run) -> dict[str, Any]:
    """See ``Part``."""
    if not peers(run):
        return {"lines": []}
    led = read_led(run)
    more = max(len(led.elections) - MOST_ELECTIONS, 0)
    return {"lines": lines(run), "elections": elections(run, led), "more": more}


def lines(run: Run) -> list[Line]:
    """The figures of metrics.json."""
    leaders, awake, age = (run.metrics[key] for key in ("leaders", "awake_share", "age_of_information_s"))
    took, healed = leaders["election_s"], leaders["healed_s"]
    split = leaders["split_elections"]
    won = f"{leaders['elections']:,}; {leaders['unwon_elections']:,} won by nobody, {split:,} by more than one"
    found: list[Line] = turn_lines(leaders) if leaders["per_step_mean"] is not None else []
    found += [
        ("terms that a head gave up", f"{leaders['dissolved']:,}", False),
        ("elections", won, False),
    ]
    if took["mean"] is not None:
        found.append(
            ("from the first claim to a head, mean and most", f"{span(took['mean'])}, {span(took['max'])}", False)
        )
    if healed["mean"] is not None:
        both = f"{span(healed['mean'])}, {span(healed['max'])}"
        found.append(("how long more than one led after an election, mean and most", both, False))
    beyond = leaders["out_of_reach_steps"]
    found.append(("steps with sensors nearer to the target out of the head's reach", f"{beyond:,}", False))
    if awake["mean"] is not None:
        shares = f"{percent(awake['mean'])}, {percent(awake['most'])}"
        found.append(("share of the time that a sensor's radio is awake, mean and most", shares, False))
    if age["mean"] is not None:
        ages = f"{span(age['mean'])}, {span(age['p95'])}"
        found.append(("how old what the base knew was, mean and 95 %", ages, False))
    return found


def elections(run: Run, led: Led) -> Table:
    """Each election: when, who claimed, who led then, and after how long."""
    rows = [_row(run, led, one) for one in led.elections[:MOST_ELECTIONS]]
    return Table(["first claim", "term", "claims", "of", "won by", "after", "two led for"], rows)


def _row(run: Run, led: Led, one: Election) -> list[str]:
    winners = ", ".join(winner.leader for winner in one.led) or _why_not(run, led, one)
    by_key = sorted(one.claims, key=lambda claim: claim[::-1])
    took, healed = (NOTHING if t_ns is None else span(t_ns / NS) for t_ns in (one.took_ns, one.healed_ns))
    at = f"{seconds(run, one.begun_ns):.2f} s"
    return [at, str(one.number), number(len(by_key)), ids(id for id, _ in by_key), winners, took, healed]


def _why_not(run: Run, led: Led, one: Election) -> str:
    """Who led as an election began that nobody won."""
    until_ns, spare_ns = led.until_ns or {}, run.site.step_ns
    for turn in reversed(led.turns):
        last_ns = max(until_ns.get((turn.number, turn.leader), 0), turn.begun_ns)
        if turn.begun_ns - spare_ns <= one.begun_ns <= last_ns + spare_ns:
            return f"nobody, as {turn.leader} led"
    return "nobody"


def heads(run: Run) -> Figure | None:
    """Who led when, and how each term began."""
    return who_led(run, read_led(run)) if peers(run) else None


FIGURES: Final[Figures] = {"heads": heads}
