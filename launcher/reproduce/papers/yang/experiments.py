"""What is run of Yang et al. without roles: trials of their field, random fields, sound, a camera."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Final

from launcher.reproduce.kernels.study import Experiment
from launcher.reproduce.papers.yang.camera import aimed
from launcher.reproduce.papers.yang.checks import TRIGGERED
from launcher.reproduce.papers.yang.solved.failing import success
from launcher.reproduce.papers.yang.solved.solving import compared
from launcher.reproduce.papers.yang.solved.waveforms import SNR_DB, SOUND_CASE, end_to_end
from launcher.reproduce.papers.yang.trials.setups import FAIL, SWEEPS, USUAL
from launcher.reproduce.papers.yang.trials.triggered import triggered

BATCH: Final = 250
"""Trials that are solved at once."""
MOST_SOUND: Final = 200
"""Runs with sound: one takes more than a second of processor time."""

EXPERIMENTS: Final[Mapping[str, Experiment]] = {
    **{name: Experiment(partial(success, setup), BATCH) for name, setup in FAIL.items()},
    **{name: Experiment(partial(compared, setup), BATCH) for name, setup in SWEEPS.items()},
    TRIGGERED: Experiment(triggered, BATCH),
    **aimed.EXPERIMENTS,
    SOUND_CASE: Experiment(partial(end_to_end, SNR_DB, USUAL), 5, MOST_SOUND),
}
"""All of them, by name."""
