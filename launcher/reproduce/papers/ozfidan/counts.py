"""How many frames of which kind a run sends in a step, and how many slaves wait to be woken: what energy is made from.

Frames are counted, not sent: nothing is lost, and nobody sends twice. In each step

- each slave that is awake *reports* to its master,
- each master that got reports *forwards* them in one frame: to the leader, if it does not lead itself; without
  scheduling to the sink,
- the leader sends its *estimate* to the sink, and when the lead changes hands over its belief (*hand-over*),
- a master sends a *beacon* to those of its slaves that are to be awake, when one of them is woken, and every
  ``BEACON_EVERY`` steps. The acknowledgement of a report says whether to sleep again.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from launcher.reproduce.kernels.study import Figures
from launcher.reproduce.papers.ozfidan.field import Setup, Truth
from launcher.reproduce.papers.ozfidan.scheduling import Flags
from launcher.reproduce.papers.ozfidan.tracks import Tracks
from trackfield.filters.gate import Indices
from trackfield.filters.types import Array

BEACON_EVERY: Final = 10
"""Steps after which those who stay awake hear another beacon."""


def counts(setup: Setup, truth: Truth, tracks: Tracks) -> Figures:
    """Means over the steps of R runs with scheduling.

    ``reports``, ``estimates``, ``handovers`` and ``asleep``, the slaves that have a master and sleep, are (R,).
    ``forwards`` and ``beacons`` (R, C + 1) are by the number of slaves that a frame is about.
    """
    theirs = _by_master(tracks.awake, setup, truth)
    others = np.arange(setup.masters) != tracks.leader[..., None]
    reports = tracks.awake.sum(axis=-1).mean(axis=1)
    return {
        "reports": reports,
        "forwards": _by_size(np.where(others, theirs, 0), setup),
        "estimates": np.ones(len(reports)),
        "handovers": (np.diff(tracks.leader, axis=1) != 0).sum(axis=1) / tracks.leader.shape[1],
        "beacons": _by_size(np.where(_beacons(tracks.awake, theirs, setup, truth), theirs, 0), setup),
        "asleep": (truth.owner >= 0).sum(axis=1) - reports,
    }


def counts_of_all(setup: Setup, truth: Truth) -> Figures:
    """The same without scheduling: every slave that has a master reports in every step."""
    has = truth.owner >= 0
    none = np.zeros(len(has))
    return {
        "reports": has.sum(axis=1).astype(float),
        "forwards": _by_size(_by_master(has[:, None], setup, truth), setup),
        "estimates": none,
        "handovers": none,
        "beacons": np.zeros((len(has), setup.capacity + 1)),
        "asleep": none,
    }


def _by_master(some: Flags, setup: Setup, truth: Truth) -> Indices:
    """How many slaves of each master are among ``some`` (R, T, S): (R, T, M)."""
    owned = truth.owner[..., None] == np.arange(setup.masters)
    return np.asarray(np.rint(some.astype(np.float32) @ owned.astype(np.float32)), int)


def _by_size(sizes: Indices, setup: Setup) -> Array:
    """Of ``sizes`` (R, T, M), how many are 1, 2, ... in a step, (R, C + 1); of those that are 0 none."""
    found = np.zeros((len(sizes), setup.capacity + 1))
    for n in range(1, setup.capacity + 1):
        found[:, n] = (sizes == n).sum(axis=(1, 2)) / sizes.shape[1]
    return found


def _beacons(awake: Flags, theirs: Indices, setup: Setup, truth: Truth) -> Flags:
    """Which masters (R, T, M) send a beacon for a step."""
    before = np.concatenate((np.zeros_like(awake[:, :1]), awake[:, :-1]), axis=1)
    woken = _by_master(awake & ~before, setup, truth) > 0
    last, found = np.full(theirs[:, 0].shape, -BEACON_EVERY), np.zeros(theirs.shape, bool)
    for step in range(theirs.shape[1]):
        found[:, step] = (woken[:, step] | (step - last >= BEACON_EVERY)) & (theirs[:, step] > 0)
        last[found[:, step]] = step
    return found
