"""The sockets of the emulated camera: the commands that it has taken and not completed."""

from __future__ import annotations

from dataclasses import dataclass, replace

from trackfield.wire.visca import SOCKETS, Command


@dataclass(frozen=True, slots=True)
class Job:
    """A command in a socket, and when it is done (local time, ns).

    ``turn`` is the command if it turns the camera; until it begins to, ``done_ns`` is None.
    """

    socket: int
    done_ns: int | None
    turn: Command | None = None


@dataclass(frozen=True, slots=True)
class Sockets:
    """The commands that were taken, at most one in each socket, in the order in which they came."""

    jobs: tuple[Job, ...] = ()

    @property
    def free(self) -> int | None:
        """The lowest socket that is free."""
        taken = {job.socket for job in self.jobs}
        return next((socket for socket in SOCKETS if socket not in taken), None)

    @property
    def turns(self) -> tuple[Job, ...]:
        """Those that turn the camera: the first of them does, and others wait for it."""
        return tuple(job for job in self.jobs if job.turn is not None)

    def of(self, socket: int) -> Job | None:
        """The command in a socket."""
        return next((job for job in self.jobs if job.socket == socket), None)

    def due(self, now: int) -> tuple[Job, ...]:
        """Those that are done by now."""
        return tuple(job for job in self.jobs if job.done_ns is not None and job.done_ns <= now)

    def taken(self, job: Job) -> Sockets:
        """With one more."""
        return Sockets((*self.jobs, job))

    def without(self, *jobs: Job) -> Sockets:
        """Without these."""
        return Sockets(tuple(job for job in self.jobs if job not in jobs))

    def begun(self, job: Job, done_ns: int) -> Sockets:
        """With one that waited and is done then."""
        return Sockets(tuple(replace(one, done_ns=done_ns) if one == job else one for one in self.jobs))
