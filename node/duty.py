"""When a node that is awake has its receiver on for the centre's commands: once in each step.

The command for a step leaves the centre right after the deadline of the step before, so no command arrives earlier;
one that has not arrived when the centre's radio must have sent all its commands will not arrive at all.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Duty:
    """Listens from ``listen_from_ns`` after the instant of each step of ``step_ns`` on, for ``listen_for_ns`` at most.

    The latter is no longer than a step.
    """

    step_ns: int
    listen_from_ns: int
    listen_for_ns: int

    def at(self, time_ns: int, known: int) -> tuple[bool, int]:
        """Whether the receiver is on at this time of the centre, for a node that has the command for step ``known``.

        Also returns how long (ns) the answer holds.
        """
        step, since = divmod(time_ns - self.listen_from_ns, self.step_ns)
        if known <= step and since < self.listen_for_ns:
            return True, self.listen_for_ns - since
        return False, self.step_ns - since
