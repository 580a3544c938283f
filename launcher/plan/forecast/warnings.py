"""Warnings of what is likely to go wrong in a run, before it starts, and a summary of what to expect."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby
from typing import Final

import numpy as np
from numpy.typing import NDArray

from launcher.plan.forecast.answers import HOST_S, answers
from launcher.plan.forecast.duty import HOUR_S, Duty
from launcher.plan.forecast.foresight import Coverage, Foresight
from launcher.plan.forecast.masters.led import doubtful, leading, who_measures
from launcher.plan.forecast.played import listening
from launcher.records import Plan
from trackfield.role import NS

POOR: Final = 0.5
"""A link that carries less than this share of its messages is poor."""
FEW: Final = 0.05
"""A problem in a smaller share of the steps or of the reports is not worth a warning: a track of which 95 % of the
steps are good counts as tracked."""
COVERED: Final = 0.8
"""A track bridges single steps without a fix; if more than one in five has none, there is a warning."""


def warnings(plan: Plan, seen: Foresight) -> tuple[str, ...]:
    """What is likely to go wrong, a sentence each; nodes that will have nothing to report are left out."""
    coverage = () if listening(plan) else seen.coverage
    geometry = [text for one in coverage for text in _out_of_reach(plan, seen, one)]
    radio = [*_lost(seen), *_late(plan, seen), *_poor_hops(seen)] if coverage else []
    weak = [] if geometry or radio else [text for one in coverage for text in _weak(seen, one)]
    channel = [*_queueing(plan, seen), *_crowded(plan, seen), *_colliding(plan, seen), *_over_duty(plan, seen)]
    leaders = doubtful(seen.scheduled) if seen.scheduled is not None else ()
    return (*geometry, *leaders, *radio, *weak, *channel, *_restless(plan, seen))


def summary(plan: Plan, seen: Foresight) -> Iterator[str]:
    """What to expect, in figures, a line each."""
    led = seen.scheduled is not None
    if many := len(listening(plan)):
        yield (
            f"recorded sound: nobody knows before the run which passes {many} of {len(plan.reaches)} sensor nodes will "
            "find in it; nothing here counts their reports"
        )
        if many == len(plan.reaches):
            return
    if seen.scheduled is not None:
        yield from who_measures(seen.scheduled)
    for one in seen.coverage:
        mean = one.in_reach.mean() if len(one.in_reach) else 0.0
        yield (
            f"coverage{_whose(seen, one)}: {_fix(seen, ' sensors')}{' that measure' * led} within "
            f"{_metres(plan.reach_m)} of the target"
            f"{', the reach at the lowest threshold,' if seen.adaptive else ''} in "
            f"{_steps(seen, one, _enough(one, seen.needs))} ({mean:.1f} on average), {_fix(seen, ' reports')} in time "
            f"in {_at_most(seen)}{_fixed(one):.0%}"
        )
    if not seen.reports:
        return
    senders = f"{len(seen.reports)} sensor node{'s' * (len(seen.reports) != 1)}"
    in_time = "" if seen.of_use is None else f", {seen.of_use:.1%} of those in time"
    yield (
        f"reports: {_at_most(seen) or 'about '}{_total(seen):.0f} from {senders}"
        f"{', at the lowest threshold' if seen.adaptive else ''}; {seen.arriving:.1%} arrive{in_time} "
        f"({_delays(seen)}; {_limit(plan)})"
    )
    if len(seen.air_s) and seen.air_s.max() > 0:
        yield (
            f"channel: a report is on air for {_time(float(np.mean(seen.trial.air_s)))}, all of a step with their "
            f"acknowledgements for {_time(float(seen.air_s.max()))} at most; a step lasts {_time(plan.step_ns / NS)}"
        )
    if (crowd := seen.crowd) is not None:
        busiest = f", the busiest of {leading(seen.scheduled)} and base" * led
        yield (
            f"on the channel at {crowd.busiest}{busiest}, "
            f"{_at_most(seen)}{crowd.use_mean:.1%} of the time is used{'' if led else ' by reports'} "
            f"({crowd.use_peak:.1%} of the busiest second); {_at_most(seen)}{crowd.overlapped:.1%} of the reports "
            f"overlap others, {_at_most(seen)}{crowd.spared:.1%} would be lost by that, which the model leaves out"
        )
    for duty in seen.duties:
        yield f"duty cycle: {_sends(duty)} in an hour at most; {duty.allowed_s:.0f} s are allowed"


# --- where the target goes --------------------------------------------------------------------------------------------


def _out_of_reach(plan: Plan, seen: Foresight, one: Coverage) -> Iterator[str]:
    """Steps in which too few sensors are in reach, whatever the radio does."""
    enough, nobody, who = _enough(one, seen.needs), one.in_reach == 0, f"the target{_whose(seen, one)}"
    is_ = "is" if seen.scheduled is None else "measures"
    few = f"{_fix(seen)} in {_at_most(seen)}{_steps(seen, one, enough)}"
    if len(nobody) and nobody.mean() >= FEW:
        begin, lasts = _longest(one, nobody, plan.step_ns / NS)
        what = (
            f"{who} is outside the field" if np.all(one.outside[nobody]) else f"the field has gaps along {who}'s path"
        )
        yield (
            f"{what}: no sensor {is_} within {_metres(plan.reach_m)} of it in "
            f"{_steps(seen, one, float(nobody.mean()))} "
            f"(longest: {lasts:g} s from t = {begin:g} s on){f', {few}' if seen.needs > 1 else ''}"
        )
    elif enough < COVERED:
        yield f"too few sensors along the path: within {_metres(plan.reach_m)} of {who}, {few}"


def _longest(one: Coverage, where: NDArray[np.bool_], step_s: float) -> tuple[float, float]:
    """The longest time for which something holds: its beginning (s), and how long it lasts (s)."""
    runs = [list(run) for holds, run in groupby(range(len(where)), key=lambda i: bool(where[i])) if holds]
    longest = max(runs, key=len)
    begin, end = one.t_s[longest[0]], one.t_s[longest[-1]]
    return float(begin), float(end - begin + step_s)


def _enough(one: Coverage, needs: int) -> float:
    """The share of steps with as many sensors in reach as a fix needs."""
    return float(np.mean(one.in_reach >= needs)) if len(one.in_reach) else 0.0


def _fixed(one: Coverage) -> float:
    """The share of steps in which as many reports arrive in time."""
    return float(np.mean(one.fixed)) if len(one.fixed) else 0.0


# --- what the radio does ----------------------------------------------------------------------------------------------


def _lost(seen: Foresight) -> Iterator[str]:
    """Links that carry less than half, and matter."""
    total = _total(seen)
    for kinds, poor in _poor(seen):
        ids = {end for link in poor for end in link if end in seen.reports}
        if sum(seen.reports[id] for id in ids) < FEW * total:
            continue
        worst = min(poor, key=lambda link: poor[link])
        yield (
            f"less than {POOR:.0%} of {', '.join(kinds)} arrive on the links of {len(ids)} of the {len(seen.reports)} "
            f"sensor nodes that will report (worst: {' to '.join(worst)}, {poor[worst]:.0%}); "
            f"{_at_most(seen)}{_about(seen)}{seen.arriving * total:.0f} of {total:.0f} reports may be expected to "
            f"arrive{_consequence(seen)}"
        )


def _poor_hops(seen: Foresight) -> Iterator[str]:
    """Links between processes without sensors that carry less than half."""
    for kind, shares in seen.hops.items():
        poor = [link for link, share in shares.items() if share < POOR]
        if poor:
            worst = min(poor, key=lambda link: shares[link])
            yield (
                f"less than {POOR:.0%} of {kind} arrive on {len(poor)} of the {len(shares)} links between processes "
                f"without sensors (worst: {' to '.join(worst)}, {shares[worst]:.0%})"
            )


def _poor(seen: Foresight) -> list[tuple[list[str], dict[tuple[str, str], float]]]:
    """The poor links, with the kinds of message that they are poor for."""
    found: list[tuple[list[str], dict[tuple[str, str], float]]] = []
    for kind, shares in seen.receptions.items():
        poor = {link: share for link, share in shares.items() if share < POOR}
        ends = {frozenset(link) for link in poor}
        same = next((kinds for kinds, other in found if {frozenset(link) for link in other} == ends), None)
        if same is not None:
            same.append(kind)
        elif poor:
            found.append(([kind], poor))
    return found


def _late(plan: Plan, seen: Foresight) -> Iterator[str]:
    """Reports that arrive too late to be used."""
    if seen.of_use is not None and 1 - seen.of_use >= FEW:
        yield (
            f"{1 - seen.of_use:.0%} of the reports that arrive are too late ({_delays(seen)}; {_limit(plan)})"
            f"{_consequence(seen)}; use a faster radio, a longer fusion.deadline_s, or fusion.max_age_s"
        )


def _weak(seen: Foresight, one: Coverage) -> Iterator[str]:
    """Losses that no other warning names."""
    if _fixed(one) < COVERED and seen.of_use is not None:
        yield (
            f"{seen.arriving * seen.of_use:.0%} of all reports may be expected to arrive in time, {_fixes(seen, one)}"
        )


def _consequence(seen: Foresight) -> str:
    """What losses and delays leave of the coverage."""
    least = min(seen.coverage, key=_fixed)
    return f", {_fixes(seen, least)}"


def _fixes(seen: Foresight, one: Coverage) -> str:
    """In how many steps enough reports arrive in time, of which target if there are several."""
    of = f" of{_whose(seen, one)}" if _whose(seen, one) else ""
    return f"{_fix(seen)}{of} in {_at_most(seen)}{_steps(seen, one, _fixed(one))}"


def _queueing(plan: Plan, seen: Foresight) -> Iterator[str]:
    """A node that cannot send as fast as it reports."""
    busy_s = float(np.mean(seen.trial.busy_s)) if len(seen.trial.busy_s) else 0.0
    step_s = plan.step_ns / NS
    if busy_s > step_s:
        yield (
            f"a report takes its node's radio {_time(busy_s)}, and a step lasts {_time(step_s)}: reports of successive "
            "steps wait for each other"
        )


def _crowded(plan: Plan, seen: Foresight) -> Iterator[str]:
    """Reports of a step that one channel cannot carry: the link models leave out collisions."""
    if not len(seen.air_s) or seen.adaptive:
        return
    air_s, step_s = float(np.mean(seen.air_s)), plan.step_ns / NS
    for limit_s, what in ((step_s, f"a step lasts {_time(step_s)}"), (seen.use_s, _limit(plan))):
        if air_s > limit_s:
            yield (
                f"the reports of a step take {_time(air_s)} on air if none collide, and {what}: one channel cannot "
                "carry them (link models leave collisions out)"
            )
            return


def _colliding(plan: Plan, seen: Foresight) -> Iterator[str]:
    """Reports that would be lost to each other, if one channel can carry them at all."""
    if seen.crowd is None or seen.adaptive or any(_crowded(plan, seen)) or not seen.crowd.flatters:
        return
    crowd = seen.crowd
    yield (
        f"about {crowd.spared:.1%} of the reports would be lost as they overlap others, or as their receiver is "
        f"sending, and link models leave that out: they lose {crowd.lost / crowd.air.expected:.1%} here, and the "
        f"channel is in use for {crowd.use_mean:.1%} of the time: the losses of the run will be a "
        "fiction; use a faster radio, acknowledgements (link.ack), or fewer reports at a time"
    )


def _over_duty(plan: Plan, seen: Foresight) -> Iterator[str]:
    """Radios that send for longer than the duty cycle of their band allows, of each role the one that sends longest."""
    for duty in seen.duties:
        if duty.seconds > duty.allowed_s and not seen.adaptive:
            yield (
                f"{_sends(duty)} in an hour, and in the band of {plan.run.link['radio']} {duty.allowed_s:.0f} s are "
                f"allowed, a duty cycle of {duty.allowed_s / HOUR_S:.0%} (link models leave it out)"
            )


# --- what the machine does --------------------------------------------------------------------------------------------


def _restless(plan: Plan, seen: Foresight) -> Iterator[str]:
    """Processes that answer each other faster than a machine brings their messages."""
    found, speed = answers(plan if seen.scheduled is None else seen.scheduled.plan), plan.run.speed
    if found is not None and found.delay_s / speed < HOST_S:
        yield (
            f"processes answer each other ({', '.join(found.kinds)}) within {_time(found.delay_s)}, "
            f"{_time(found.delay_s / speed)} of wall time at --speed {speed:g}, and a busy machine takes up to "
            f"{_time(HOST_S)} to bring a frame: over processes the run may lag more and more (timing.lag_ms); use "
            f"--speed {found.delay_s / HOST_S:.2g} or less, or a link with a longer delay; --virtual needs neither"
        )


# --- words ------------------------------------------------------------------------------------------------------------


def _sends(duty: Duty) -> str:
    return f"{duty.id} sends {duty.what} for {_time(duty.seconds)}"


def _total(seen: Foresight) -> float:
    """How many reports there will be."""
    return sum(seen.reports.values())


def _whose(seen: Foresight, one: Coverage) -> str:
    """The target's id, if there are several."""
    return f" {one.target}" if len(seen.coverage) > 1 else ""


def _at_most(seen: Foresight) -> str:
    """An adaptive threshold is higher than the lowest one, for most of the time."""
    return "up to " if seen.adaptive else ""


def _about(seen: Foresight) -> str:
    """Figures are extrapolated if not all steps were looked at."""
    return "about " if seen.every > 1 else ""


def _steps(seen: Foresight, one: Coverage, share: float) -> str:
    """A share of a target's steps, as a number of them."""
    steps = min(len(one.t_s) * seen.every, seen.steps)
    return f"{_about(seen)}{share * steps:.0f} of {steps} steps"


def _fix(seen: Foresight, what: str = "") -> str:
    """As many as a fix needs."""
    return f"enough{what} for a fix ({seen.needs})" if seen.needs > 1 else f"at least 1{what[:-1]}"


def _delays(seen: Foresight) -> str:
    """How long reports take."""
    if not len(seen.delay_s):
        return "none arrives"
    median, most = np.quantile(seen.delay_s, (0.5, 0.95))
    same = most < 1.01 * median
    return f"delay {_time(float(median))}{'' if same else f', 95% within {_time(float(most))}'}"


def _limit(plan: Plan) -> str:
    if plan.max_age_s > plan.deadline_s:
        return f"fusion.max_age_s is {_time(plan.max_age_s)}"
    return f"fusion.deadline_s is {_time(plan.deadline_s)}"


def _metres(value: float) -> str:
    return f"{value:.0f} m" if value < 10_000 else f"{value / 1000:.0f} km"


def _time(seconds: float) -> str:
    return f"{seconds:.3g} s" if seconds >= 1 else f"{seconds * 1e3:.3g} ms"
