"""A fifth of the reports late by 1-3 steps: ``python -m tests.late_reports`` prints what that does to the track."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fusion.role import Fusion
from tests.sensing import arrays
from tests.zhai_field import GRID, hear, s1
from trackfield.filters.metrics import rmse
from trackfield.filters.types import Array
from trackfield.role import NS, Event, Publish, Received, Started, Timer
from trackfield.wire.messages import Doa

DEADLINE = 300_000_000
SHARE = 0.2


def rmse_of_s1(seeds: Sequence[int]) -> tuple[float, float, float]:
    """Position error (m) of the last word on each step: all on time; late and replayed; late and dropped."""
    runs = [[_errors(seed, share, age) for seed in seeds] for share, age in ((0.0, 0), (SHARE, 4 * NS), (SHARE, 0))]
    on_time, replayed, dropped = (rmse(np.concatenate(errors)) for errors in runs)
    return on_time, replayed, dropped


def _errors(seed: int, share: float, max_age_ns: int) -> Array:
    """Errors (T, 2) over the steps of s1 that have a track; the last steps' late reports come after the end."""
    truth = s1(np.random.default_rng(seed))
    fusion = Fusion(
        trackers=["imm-ukf"],
        sensors=[(f"n{i:03d}", float(x), float(y)) for i, (x, y) in enumerate(GRID)],
        step_ns=NS,
        deadline_ns=DEADLINE,
        sensing=arrays(),
        seed=seed,
        max_age_ns=max_age_ns,
    )
    memory, last = fusion.handle(fusion.begin(), Started(0))[0], {}
    for event in _events(seed, truth, share):
        memory, effects = fusion.handle(memory, event)
        last.update({e.estimate.step: e.estimate for e in effects if isinstance(e, Publish)})
    places = {step: np.array(point.mean[:2]) for step, point in last.items() if point.mean and step < len(truth)}
    return np.array([place - truth[step, :2] for step, place in places.items()])


def _events(seed: int, truth: Array, share: float) -> list[Event]:
    draw, delays = np.random.default_rng([seed, 1]), np.random.default_rng([seed, 2])
    events: list[Event] = [Timer(step * NS + DEADLINE, "deadline") for step in range(1, len(truth) + 3)]
    for step in range(1, len(truth)):
        heard = hear(truth[step, :2], draw, step=step)
        for id, bearing, level in zip(heard.sensors, heard.bearings, heard.levels, strict=True):
            late = int(delays.integers(1, 4)) if delays.random() < share else 0
            report = Doa(step, round(float(np.degrees(bearing)) % 360.0, 2) % 360.0, float(level))
            events.append(Received((step + late) * NS + 1_000_000, report, id))
    return sorted(events, key=lambda event: event.now)


def main() -> None:
    """One line for each way."""
    ways = ("all on time", "late, replayed", "late, dropped")
    for way, error in zip(ways, rmse_of_s1(range(20)), strict=True):
        print(f"{way:15} {error:.3f} m")


if __name__ == "__main__":
    main()
