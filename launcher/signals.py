"""The signals that ask the program to end."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from threading import Event
from typing import Final

ENDING: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Ctrl-C, a plain kill, and a terminal that is closed."""

LOOK_S: Final = 0.5


class Interrupted(KeyboardInterrupt):
    """A signal asks the program to end.

    A class of its own: once a plain ``KeyboardInterrupt`` has left ``exec``, as in the making of a dataclass,
    ``python -m`` kills itself by SIGINT at its end, even if the program caught it.
    """


@contextmanager
def handling(handle: Callable[[int], object], numbers: Iterable[signal.Signals] = ENDING) -> Iterator[None]:
    """Call ``handle`` with the number of each of these signals that comes.

    A closed terminal is no signal for a program that was told to ignore it (``nohup``). Only the main thread can
    handle signals; in another, nothing changes. A handler that was not set from Python cannot be put back; the
    default takes its place.
    """
    old = {}
    try:
        for number in numbers:
            if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:
                old[number] = signal.signal(number, lambda number, _: handle(number))
    except ValueError:  # not the main thread: the caller handles signals
        pass
    try:
        yield
    finally:
        for number, handler in old.items():
            signal.signal(number, signal.SIG_DFL if handler is None else handler)


def wait_for(done: Event) -> None:
    """Wait for what a signal's handler sets, and look up now and then: a signal that comes as a wait begins is handled
    only after it.
    """
    while not done.wait(LOOK_S):
        pass
