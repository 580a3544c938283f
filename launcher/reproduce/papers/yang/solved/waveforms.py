"""From sound to path, without radio: what five microphones hear of a pass, the detectors, the solvers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np

from launcher.reproduce.kernels.draws import generators
from launcher.reproduce.kernels.study import Figures
from launcher.reproduce.papers.yang.solved.solving import ECPA, ML, by, figures_of
from launcher.reproduce.papers.yang.trials.field import Setup, crossing
from launcher.reproduce.papers.yang.trials.sensitivity import C
from trackfield.acoustics.listener import Detection, Listener
from trackfield.acoustics.microphone import Microphone
from trackfield.acoustics.signals import RATE
from trackfield.acoustics.sources import engine
from trackfield.filters.passes.bounds import line_errors
from trackfield.filters.passes.types import Passes
from trackfield.filters.types import Array
from trackfield.models import passing
from trackfield.role import NS
from trackfield.world.path import Path

PASS_S: Final = 12.0
"""When the target is nearest to the centroid of the nodes; before, they hear how quiet it is without it."""
END_S: Final = 18.0
SNR_DB: Final = 10.0
"""At 20 m."""
SOUND_CASE: Final = "sound"
WAYS: Final[Mapping[str, tuple[str, str]]] = {
    "argmax + ecpa": ("argmax", ECPA),
    "fit + ecpa": ("fit", ECPA),
    "fit + ml": ("fit", ML),
}
"""Detector and solver by name."""
_DB: Final = 20.0 / np.log(10.0)


class Recording(NamedTuple):
    """What a node heard: ``samples`` (N,) from time 0 on, and when (s) it truly was loudest, at ``distance_m``."""

    samples: Array
    loudest_s: float
    distance_m: float


def end_to_end(snr_db: float, setup: Setup, seeds: Sequence[int]) -> Figures:
    """Errors of every way; ``missed`` and ``false``: nodes without, and with more than, one report in a run.

    ``time DETECTOR`` (R, K) is by how many widths d / v a time is off, NaN without a report.
    """
    found = [_run(snr_db, setup, seed) for seed in seeds]
    return {name: np.concatenate([one[name] for one in found]) for name in found[0]}


def _run(snr_db: float, setup: Setup, seed: int) -> dict[str, Array]:
    truth, recordings = recorded(snr_db, setup, seed)
    figures: dict[str, Array] = {}
    width = np.maximum([one.distance_m for one in recordings], 1.0) / setup.speed
    for detector in dict.fromkeys(detector for detector, _ in WAYS.values()):
        told = [detections(one.samples, detector) for one in recordings]
        passes = passes_of(setup.places, [some[0] if some else None for some in told])
        off = passes.times_s[0] - [one.loudest_s for one in recordings]
        counts = np.array([len(some) for some in told])
        figures |= {
            f"time {detector}": (off / width)[None],
            f"missed {detector}": np.array([float((counts == 0).sum())]),
            f"false {detector}": np.array([float(np.maximum(counts - 1, 0).sum())]),
        }
        for name, (which, solver) in WAYS.items():
            if which == detector:
                errors = line_errors(by(solver)(passes), truth[None], setup.places.mean(axis=0))
                figures |= figures_of(name, errors)
    return figures


def recorded(snr_db: float, setup: Setup, seed: int) -> tuple[Array, list[Recording]]:
    """The true state (4,) at ``PASS_S``, and what each node of a field heard of that target."""
    (truth,) = crossing(setup.places, setup.speed, generators([seed], "line"))
    x, y, vx, vy = truth.tolist()
    knots = [(t, x + vx * (t - PASS_S), y + vy * (t - PASS_S), vx, vy) for t in (0.0, END_S)]
    path, sound = Path.of(knots), engine(seed, "target")
    loudest = PASS_S + passing.times(truth, setup.places, C)
    distance = passing.distances(truth, setup.places)
    heard = []
    for node, place in enumerate(setup.places.tolist()):
        microphone = Microphone([path], tuple(place), [sound], seed=seed, id=f"n{node:03}", snr_db=snr_db, sound_m_s=C)
        samples = np.concatenate([some for _, some in microphone.blocks(0, round(END_S * NS))])
        heard.append(Recording(samples, float(loudest[node]), float(distance[node])))
    return truth, heard


def detections(samples: Array, detector: str) -> list[Detection]:
    """The passes in a recording."""
    listener = Listener(detector)
    return [one for part in np.split(samples, range(RATE, len(samples), RATE)) for one in listener.feed(part)]


def passes_of(places: Array, told: Sequence[Detection | None]) -> Passes:
    """The reports (1, K) of nodes at ``places`` (K, 2), of which some may have none."""

    def column(field: str) -> Array:
        return np.array([[np.nan if one is None else getattr(one, field) for one in told]], float)

    return Passes(
        places=places[None],
        times_s=column("peak_s"),
        strengths=10.0 ** (column("strength_db") / 20.0),
        time_sd_s=column("time_sd_s"),
        strength_sd=column("strength_sd_db") / _DB,
    )
