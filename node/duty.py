"""When a node that is awake has its receiver on for the centre's commands: a duty cycle that follows the steps.

The command for a step leaves the centre right after the deadline of the step before, so nothing comes earlier, and
what has not come when the centre's radio must be done with all its commands will not come at all.
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
        """Whether the receiver is to be on at the centre's time, for one who knows the command for step ``known``.

        With it, how long (ns) until that is to be asked again.
        """
        step, since = divmod(time_ns - self.listen_from_ns, self.step_ns)
        if known <= step and since < self.listen_for_ns:
            return True, self.listen_for_ns - since
        return False, self.step_ns - since
