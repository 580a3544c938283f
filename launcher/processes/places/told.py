"""Where the processes of a run are, told to whoever brings about the faults of their containers: places.json."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from launcher.files import PLACES, write_whole
from launcher.records import Plan
from trackfield.wire.keys import id_of

LOOK_S: Final = 0.2
"""How often to look for changes."""


class Told:
    """Writes the file when emulated time begins, when a place is taken on another host, and when the run is over."""

    def __init__(self, plan: Plan, folder: Path) -> None:
        self._file = folder / PLACES
        self._told: dict[str, Any] = {
            "run": plan.run.run,
            "speed": plan.run.speed,
            "first_step_s": plan.origin_ns / 1e9,
            "faults": [one.plain() for one in plan.aways],
        }
        self._wanted = bool(plan.aways)
        self._written: dict[str, Any] = {}
        self._look_at, self._over = 0.0, False

    def look(self, start_ns: int | None, hosts: Mapping[str, str], *, over: bool = False) -> None:
        """Write what is new: the monotonic time (ns) at which emulated time began, the host of each life.

        To be called often; once ``over``, it stays so. A disk that takes nothing is tried again.
        """
        now = time.monotonic()
        self._over |= over
        if not self._wanted or start_ns is None or (now < self._look_at and not over):
            return
        self._look_at = now + LOOK_S
        places = {id_of(name): host for name, host in dict(hosts).items()}
        new = {**self._told, "begun_ns": start_ns, "places": places, "over": self._over}
        if new != self._written:
            with suppress(OSError):
                write_whole(self._file, json.dumps(new, indent=2) + "\n")
                self._written = new
