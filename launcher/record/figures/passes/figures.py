"""``passes`` of metrics.json with types."""

from __future__ import annotations

from collections.abc import Mapping

from launcher.record.figures.frames import Count, Figures, Number


class Size(Figures):
    """Mean and maximum."""

    mean: Number | None
    max: Number | None


class Fixes(Figures):
    """What a tracker made of passes: fixes, their errors, how long after the last pass they came."""

    fixes: Count
    false_fixes: Count | None
    fixes_per_pass: Number | None
    refused: Mapping[str, Count]
    reports_used: Number | None
    location_m: Size
    speed_m_s: Size
    heading_deg: Size
    delay_s: Size
    base_delay_s: Size


class PassFigures(Figures):
    """How often a target passed a cluster, and how often enough sensors heard it; ``trackers`` by their names."""

    events: Count
    enough: Count
    trackers: Mapping[str, Fixes]

    def of(self, tracker: str) -> dict[str, float | None]:
        """What a tracker made of them; by their names in a study."""
        found = self.trackers.get(tracker)
        return {
            "passes.fixes_per_pass": None if found is None else found.fixes_per_pass,
            "passes.location_m.mean": None if found is None else found.location_m.mean,
            "passes.speed_m_s.mean": None if found is None else found.speed_m_s.mean,
            "passes.delay_s.mean": None if found is None else found.delay_s.mean,
        }
