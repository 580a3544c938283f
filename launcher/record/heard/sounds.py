"""What sensors heard of an event: made again from scenario and seed, sample by sample as in the run."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from launcher.heard import Array, Event, Sound
from launcher.records import Plan
from trackfield.acoustics.listener import Detection, Listener
from trackfield.acoustics.signals import RATE
from trackfield.role import NS
from trackfield.sensing.cpa import Cpa
from trackfield.sensing.listening import blocks_of
from trackfield.world.placed import Placed

BEFORE_NS: Final = 4 * NS
AFTER_NS: Final = 3 * NS
"""So much before and after a pass is shown."""
NEAR_NS: Final = NS
"""A detection is that of a report if they are no further apart."""
TINY: Final = 1e-20


def sounds(plan: Plan, event: Event, which: list[str]) -> Iterator[Sound]:
    """What these sensors heard of it; nothing of those that do not listen, or that were not alive."""
    for report in event.reports:
        if report.sensor in which and (placed := _placed(plan, report.sensor, report.at_ns)) is not None:
            yield from _heard(placed, report.at_ns)


def loudest_and_weakest(event: Event) -> list[str]:
    """The two sensors of an event between which all others are."""
    ranked = event.ranked
    return list(dict.fromkeys([ranked[0], ranked[-1]])) if ranked else []


def _placed(plan: Plan, id: str, at_ns: int) -> Placed | None:
    """The sensor as it lived at this time, if it listens."""
    for process in plan.processes:
        lives = process.start_ns <= at_ns and (process.kill_ns is None or at_ns < process.kill_ns)
        if process.id == id and process.sound and lives:
            placed = Placed.from_plain(process.sound)
            return placed if isinstance(placed.kind.own, Cpa) and placed.kind.hearing is not None else None
    return None


def _heard(placed: Placed, at_ns: int) -> Iterator[Sound]:
    """From where it begins to listen, as what is found in sound depends on what was before; then cut to the pass."""
    lead_ns = round(placed.kind.memory_s * NS)
    window = next((one for one in placed.windows if one[0] - lead_ns <= at_ns <= one[1]), None)
    if window is None:
        return
    own: Cpa = placed.kind.own
    listener, kept, told = Listener(own.detector), list[tuple[int, Array]](), list[Detection]()
    for first_ns, samples in blocks_of(own, placed.audible)(
        max(window[0] - lead_ns, 0), min(window[1], at_ns + AFTER_NS)
    ):
        kept.append((first_ns, samples))
        told += listener.feed(samples)
    if kept:
        yield _cut(placed.id, kept, listener, [one for one in told if _near(kept[0][0], one, at_ns)], at_ns)


def _near(begun_ns: int, detection: Detection, at_ns: int) -> bool:
    return abs(begun_ns + detection.peak_s * NS - at_ns) <= NEAR_NS


def _cut(id: str, kept: list[tuple[int, Array]], listener: Listener, told: list[Detection], at_ns: int) -> Sound:
    """The samples around a pass, the levels in dB and the curve fitted to them, and when the pass was found."""
    begun_ns, samples = kept[0][0], np.concatenate([some for _, some in kept])
    first = max(round((at_ns - BEFORE_NS - begun_ns) / NS * RATE), 0)
    last = max(round((at_ns + AFTER_NS - begun_ns) / NS * RATE), 0)
    first_s = first / RATE
    heard = listener.heard
    curve = (
        min(listener.passes, key=lambda one: abs(begun_ns + one.peak_s * NS - at_ns), default=None) if told else None
    )
    shown = (heard.t_s >= first_s) & (heard.t_s < last / RATE)
    t_s = heard.t_s[shown]
    fitted = np.full(len(t_s), np.nan) if curve is None else np.array(curve.at(t_s)) + curve.floor
    levels = np.stack((t_s - first_s, _db(heard.energies[shown]), _db(fitted)), axis=1)
    peak_ns, known_ns = (
        (begun_ns + round(told[0].peak_s * NS), begun_ns + round(told[0].known_s * NS)) if told else (None, None)
    )
    return Sound(id, begun_ns + round(first_s * NS), RATE, samples[first:last], levels, peak_ns, known_ns)


def _db(power: Array) -> Array:
    return np.asarray(10.0 * np.log10(np.maximum(power, TINY)))
