"""What is computed for one pass of a target by five nodes: detection and solution, or what others compute (sec. 2)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Final

import numpy as np

from launcher.reproduce.kernels.study import Found
from launcher.reproduce.kernels.turns import taken
from launcher.reproduce.papers.yang.solved.messages import AUDIO_HZ, RECORDED_S
from launcher.reproduce.papers.yang.solved.rivals import WINDOW_S, delays, direction, ekf_fit, steering, windows
from launcher.reproduce.papers.yang.solved.solving import ECPA, EKF, ML, SOLVERS
from launcher.reproduce.papers.yang.solved.waveforms import PASS_S, SNR_DB, recorded
from launcher.reproduce.papers.yang.trials.field import trials
from launcher.reproduce.papers.yang.trials.setups import USUAL
from launcher.reproduce.tables import aligned
from trackfield.acoustics.listener import Listener
from trackfield.filters.passes.types import Passes
from trackfield.filters.types import Array

HIGHEST, DETECTION, TDOA, DOA = "highest amplitude", "detection, fit", "tdoa", "doa"
MICROPHONES: Final = 0.1 * np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0]])
"""Of an array for directions of arrival, m."""
TOLD: Final = {
    HIGHEST: "five nodes, 5 s of audio each: the sample with the highest amplitude, as in the paper",
    DETECTION: "five nodes, 5 s of audio each: high-pass, energies, fits",
    ECPA: "one path from five reports, without a covariance",
    ML: "one fix from five reports, with its covariance",
    EKF: "50 readings, one each 0.5 s of every node",
    TDOA: "the delays of all pairs of five nodes, in ten windows of 0.5 s",
    DOA: "the directions at five arrays of four microphones, in ten windows of 0.5 s",
}
"""What each of the times is of."""


def times() -> dict[str, list[float]]:
    """Processor times (s) of all that ``TOLD`` has, taken in turns."""
    audio = _audio()
    one = trials(USUAL, [1]).passes
    often = int(RECORDED_S / WINDOW_S)
    reports: list[Any] = [np.concatenate([part] * often, axis=1) for part in one[:-1]]
    many = Passes(*reports)._replace(place_sd_m=one.place_sd_m)
    contenders: dict[str, Callable[[], object]] = {
        HIGHEST: lambda: np.abs(audio).argmax(axis=-1),
        DETECTION: partial(_detection, audio),
        ECPA: partial(SOLVERS[ECPA], one),
        ML: partial(SOLVERS[ML], one),
        EKF: partial(ekf_fit, many),
        TDOA: partial(_tdoa, audio),
        DOA: partial(_doa, audio, steering(MICROPHONES, int(WINDOW_S * AUDIO_HZ), AUDIO_HZ)),
    }
    return taken(contenders)


def _audio() -> Array:
    """(5, N): what five nodes hear of a pass."""
    _, recordings = recorded(SNR_DB, USUAL, 1)
    begin = int((PASS_S - RECORDED_S / 2.0) * AUDIO_HZ)
    return np.stack([one.samples[begin : begin + int(RECORDED_S * AUDIO_HZ)] for one in recordings])


def _detection(audio: Array) -> None:
    for samples in audio:
        Listener("fit").feed(samples)


def _tdoa(audio: Array) -> None:
    for part in windows(audio, AUDIO_HZ):
        delays(part, AUDIO_HZ)


def _doa(audio: Array, steered: Array) -> None:
    for samples in audio:
        array = np.stack([np.roll(samples, k) for k in range(len(MICROPHONES))])
        for part in windows(array, AUDIO_HZ):
            direction(part, steered)


def least(found: Found, name: str) -> float:
    """The time (s) of one of them; other work of the machine only adds to it."""
    return min(found.times[name])


def costs(times: Mapping[str, Sequence[float]]) -> str:
    """The ``times`` (s), and as multiples of that of ``ecpa``, in Markdown; alone they depend on the machine."""
    unit = min(times[ECPA])
    rows = [
        [name, what, f"{1e3 * min(times[name]):.2f}", f"{min(times[name]) / unit:.2f}"] for name, what in TOLD.items()
    ]
    return aligned(("what", "for one pass", "ms", "of ecpa's"), rows)
