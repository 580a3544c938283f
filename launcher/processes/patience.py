"""How long a deployment waits for its processes, and what it allows them (s of wall time)."""

from __future__ import annotations

from typing import Final

CONNECT_TIMEOUT_S: Final = 10.0
"""For a router that should run already; one that is started here may take as long as any process."""
READY_TIMEOUT_S: Final = 60.0
READY_PER_PROCESS_S: Final = 0.05
LEAD_S: Final = 0.5
LEAD_PER_PROCESS_S: Final = 0.001
"""Between an order and its time of effect, so that every process has it in time."""
NICENESS: Final = 5
"""Of nodes: router, recorder and fusion centre come first, as all others wait for them."""
SETTLE_S: Final = 5.0
"""How long processes that have reached the end may put and take back frames."""
WAVE_S: Final = 0.02
"""How often to see whether all of them have answered how much they put and got."""
PAUSE_S: Final = 0.5
"""How long to wait at most before all are asked again."""
OVERDUE_S: Final = 20.0
"""After the end, how long (wall time) a process may take to say that it has reached it, or to do what is left."""
STILL_S: Final = 5.0
"""The same for a process that was stopped from outside, and also before the start."""
NEEDED_STILL_S: Final = 3.0
"""How long may stand still what all others need: less than a lease of Zenoh's sessions."""
ROUTER_AWAY_S: Final = 5.0
"""How long an external router may be away."""
MAX_RESTARTS: Final = 5
"""Of one process; one that dies more often is taken to be broken."""
REPEAT_S: Final = 0.3
"""How long after a process joined or returned all orders are repeated: it may have missed them."""
PROBE_S: Final = 2.0
"""How often to see whether somebody else answers in the launcher's place."""
POLL_S: Final = 0.1
STOP_TIMEOUT_S: Final = 10.0
STOP_PER_PROCESS_S: Final = 0.01
WRITE_TIMEOUT_S: Final = 60.0
