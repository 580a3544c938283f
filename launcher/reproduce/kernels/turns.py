"""Processor times of what is compared, taken in turns, so that other load on the machine befalls all alike."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Final

REPEATS: Final = 7
"""The least of them is the figure, as other work of the machine only adds to it."""


def taken(contenders: Mapping[str, Callable[[], object]], repeats: int = REPEATS) -> dict[str, list[float]]:
    """Processor time (s) of each call by name, ``repeats`` times, after one call that does not count."""
    for run in contenders.values():
        run()
    times: dict[str, list[float]] = {name: [] for name in contenders}
    for _ in range(repeats):
        for name, run in contenders.items():
            begun = time.process_time()
            run()
            times[name].append(time.process_time() - begun)
    return times
