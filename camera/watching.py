"""For whom the camera is, and who waits for it: the target that it meets first wins, until it has left the picture."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

from camera.aiming import Camera, aim_at, film_s
from camera.fixes import Target
from camera.line import BEGUN, Driver, Phase
from camera.memory import KNOWN, MOST_WAITING, Memory, Step, Watch, pack, with_fix, without
from camera.settings import USEFUL_S, Settings
from trackfield.models.pointing import Aim, Direction, towards
from trackfield.role import NS, CancelTimer, Effect, Note, Send, SetTimer, Store, Tell
from trackfield.wire.outside import ITEMS, Capture

HOLD_NS: Final = NS
"""From the aim on a target is watched for so long if others wait: ten frames of video."""
MOST_FAILURES: Final = 3
"""So many turns for one target may fail."""


@dataclass(frozen=True)
class Watching:
    """The part of camera control that chooses, aims, and has video captured."""

    settings: Settings
    driver: Driver

    # --- fixes -----------------------------------------------------------------------------------------------------

    def fix(self, memory: Memory, now: int, target: Target) -> Step:
        """A fix came."""
        if target.key in memory.fixes:
            return memory, (self._told(memory, now, target, "repeated"),)
        memory = replace(memory, fixes=(*memory.fixes, target.key)[-KNOWN:])
        if any(one.at_ns >= target.at_ns and one.same(target) for one in memory.used):
            return memory, (self._told(memory, now, target, "superseded"),)
        if memory.line.phase is not Phase.READY:
            return self._kept(memory, now, target)
        aim = self._aim(memory, now, target)
        if aim is None:
            return memory, (*self._no_aim(memory, now, target), self._told(memory, now, target, "out of reach"))
        return self._new(with_fix(memory, target), now, target, aim)

    def _new(self, memory: Memory, now: int, target: Target, aim: Aim) -> Step:
        """A fix that can be aimed at, so: the camera is for it, or it waits."""
        watch, aim_ns = memory.watch, memory.time.corrected(now) + round(aim.after_s * NS)
        mine = Watch(target, aim_ns=aim_ns)
        if watch is None or watch.target.same(target):
            return self._turn(_watched(memory, mine), now)
        if aim_ns >= watch.aim_ns:
            note = Note(f"{_named(target)} waits: {_named(watch.target)} is nearer in time")
            later = self._told(memory, now, target, "later", aim)
            memory, effects = _hurried(_waits(memory, target), now)
            return memory, (note, later, *effects)
        note = Note(f"{_named(target)} is nearer in time than {_named(watch.target)}, which waits")
        memory, effects = self._turn(_watched(_waits(memory, watch.target), mine), now)
        return memory, (note, *effects)

    def _kept(self, memory: Memory, now: int, target: Target) -> Step:
        """The camera is not to be had now; the newest fix of each target waits for it."""
        memory = with_fix(memory, target)
        watch = memory.watch
        if watch and watch.target.same(target):
            memory = replace(memory, watch=replace(watch, target=target, shot=0, failures=0))
        else:
            memory = _waits(memory, target)
        if memory.line.phase is not Phase.LOST:
            return memory, ()
        return memory, (self._told(memory, now, target, "camera lost"),)

    # --- aiming ----------------------------------------------------------------------------------------------------

    def _aim(self, memory: Memory, now: int, target: Target) -> Aim | None:
        line = memory.line
        camera = Camera(self.driver.look(line, now), self.driver.lead_ns(line, now) / NS)
        return aim_at(target, camera, memory.time.corrected(now), self.settings)

    def _turn(self, memory: Memory, now: int) -> Step:
        """Turn the camera to whom it is for, as soon as the line is free."""
        watch = memory.watch
        if watch is None or not memory.line.free:
            return memory, ()
        aim = self._aim(memory, now, watch.target)
        if aim is None:
            told = self._told(memory, now, watch.target, "out of reach")
            memory, effects = self._next(replace(memory, watch=None), now)
            return memory, (told, CancelTimer("over"), *effects)
        out, at_ns = self.driver.turn(memory.line, now, aim.to), memory.time.corrected(now)
        turned_s = (out.line.rests_ns - now) / NS
        lasts_s, until_s = film_s(watch.target, aim, turned_s, at_ns, self.settings)
        watch = replace(
            watch,
            shot=memory.shots + 1,
            aim_ns=at_ns + round(aim.after_s * NS),
            until_ns=now + round(until_s * NS),
        )
        memory, timers = _hurried(replace(memory, line=out.line, watch=watch, shots=watch.shot), now)
        told = self._told(memory, now, watch.target, "aimed", aim, watch.shot)
        memory, captures = self._capture(replace(memory, film_s=lasts_s), now, watch.shot)
        over = timers or (SetTimer("over", watch.until_ns),)
        return memory, (*out.effects, *captures, told, *over, Store(pack(memory)))

    def news(self, memory: Memory, now: int, news: str) -> Step:
        """What is new of the camera may be that it can be told where to look."""
        watch = memory.watch
        if news == "failed" and watch is not None:
            watch = replace(watch, shot=0, failures=watch.failures + 1)
            memory = replace(memory, watch=watch if watch.failures < MOST_FAILURES else None)
        if news in ("lost", BEGUN) and watch is not None:
            memory = replace(memory, watch=replace(watch, shot=0))
        if not memory.line.free:
            return memory, ()
        if memory.watch is None:
            return self._next(memory, now)
        return (memory, ()) if memory.watch.shot else self._turn(memory, now)

    def over(self, memory: Memory, now: int) -> Step:
        """The target has left the picture; the next one's turn. Without the camera it is still waited for."""
        if memory.watch is not None and not memory.watch.shot:
            return memory, ()
        return self._next(replace(memory, watch=None), now)

    def _next(self, memory: Memory, now: int) -> Step:
        """Of those that wait the camera is for the one that it meets first, if it meets any."""
        at_ns = memory.time.corrected(now)
        waiting = tuple(one for one in memory.waiting if one.age_s(at_ns) <= USEFUL_S)
        memory = replace(memory, waiting=waiting)
        if not waiting or not memory.line.free:
            return memory, ()
        aims = [(aim.after_s, i) for i, one in enumerate(waiting) if (aim := self._aim(memory, now, one))]
        if not aims:
            return memory, ()
        target = waiting[min(aims)[1]]
        memory, effects = self._turn(_watched(memory, Watch(target)), now)
        return memory, (Note(f"{_named(target)} has waited, and is aimed at now"), *effects)

    # --- video -----------------------------------------------------------------------------------------------------

    def _capture(self, memory: Memory, now: int, shot: int, again: bool = False) -> Step:
        """Ask for video of a shot; it should be over after that, and the answer have come."""
        send = Send(Capture(shot % ITEMS, memory.film_s), self.settings.video, "backbone")
        due_ns = now + round(memory.film_s * NS) + self.settings.patience_ns
        return replace(memory, filmed=shot, again=again), (send, SetTimer("captured", due_ns))

    def captured(self, memory: Memory, number: int) -> Step:
        """The video of a shot is over."""
        if not memory.filmed or number != memory.filmed % ITEMS:
            return memory, ()
        return replace(memory, filmed=0), (CancelTimer("captured"),)

    def uncaptured(self, memory: Memory, now: int) -> Step:
        """Nothing was heard of a video that should be over: it is asked for again, once."""
        if memory.filmed and not memory.again:
            return self._capture(memory, now, memory.filmed, again=True)
        note = Note(f"no video of shot {memory.filmed}: {self.settings.video} does not answer")
        return replace(memory, filmed=0), (note,)

    # --- what is told ----------------------------------------------------------------------------------------------

    def _told(
        self, memory: Memory, now: int, target: Target, outcome: str, aim: Aim | None = None, shot: int = 0
    ) -> Effect:
        """``Tell("aimed")``; without an aim, of where the target is now."""
        at_ns = memory.time.corrected(now)
        x, y = target.at(at_ns)
        aim = aim or Aim(0.0, x, y, towards(self.settings.mount, x, y))
        look: Direction = aim.to
        head = (shot, target.head, target.step, target.delay_s, target.cpa_ns, at_ns + round(aim.after_s * NS))
        return Tell("aimed", (*head, aim.x_m, aim.y_m, *look, outcome))

    def _no_aim(self, memory: Memory, now: int, target: Target) -> tuple[Effect, ...]:
        age_s = target.age_s(memory.time.corrected(now))
        return (Note(f"the fix of {_named(target)} is {age_s:.1f} s old"),) if age_s > USEFUL_S else ()


def _watched(memory: Memory, watch: Watch) -> Memory:
    """The camera is for this target now."""
    return replace(memory, watch=watch, waiting=without(memory.waiting, watch.target))


def _waits(memory: Memory, target: Target) -> Memory:
    """A target waits, instead of an older fix of itself, or the one that waits longest."""
    return replace(memory, waiting=(*without(memory.waiting, target), target)[-MOST_WAITING:])


def _hurried(memory: Memory, now: int) -> Step:
    """While others wait, the camera is for its target no longer than is needed."""
    watch = memory.watch
    if watch is None or not watch.shot or not memory.waiting:
        return memory, ()
    until_ns = max(memory.time.local(watch.aim_ns) + HOLD_NS, now)
    if until_ns >= watch.until_ns:
        return memory, ()
    return replace(memory, watch=replace(watch, until_ns=until_ns)), (SetTimer("over", until_ns),)


def _named(target: Target) -> str:
    return f"event {target.number} of {target.head}"
