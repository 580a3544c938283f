"""When a track is expected of sensors that report passes alone: for some time after enough of them did."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from trackfield.sensing.cpa import Cpa

ENOUGH: Final = Cpa.fix_sensors
"""A path follows from the reports of so many sensors."""
DELAY_NS: Final = 2_000_000_000
"""So long after a report its event is waited out, and solved at a step."""
KEPT_NS: Final = 10_000_000_000
"""For so long after a report a fix that it is part of is worth predicting."""


def awaited_steps(passes: Mapping[str, Mapping[int, int]], origin_ns: int, step_ns: int, steps: int) -> set[int]:
    """The steps k, from 1 to ``steps``, at which a track is expected of these reports: when (ns), by sensor and step.

    Those for which at least ``ENOUGH`` sensors reported between ``KEPT_NS`` and ``DELAY_NS`` before.
    """
    sensors_at = dict[int, set[str]]()
    for id, reports in passes.items():
        for t_ns in reports.values():
            first = -(-(t_ns + DELAY_NS - origin_ns) // step_ns)
            for k in range(max(first, 1), min((t_ns + KEPT_NS - origin_ns) // step_ns, steps) + 1):
                sensors_at.setdefault(k, set()).add(id)
    return {k for k, ids in sensors_at.items() if len(ids) >= ENOUGH}
