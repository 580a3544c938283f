"""A figure of each tracker on the fields of ``tests.matrix`` that it takes: docs/trackers/NAME.png.

    python -m tests.matrix_figures [--runs 10] [--trackers imm-ukf ukf] [--out docs/trackers]

Above the first run, from a prior; below the position error, rms over the runs, and the bound.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from launcher.colours import tracker_colours
from launcher.report.style import SOFT, STYLE, TRUTH
from tests.matrix import FIELDS, PLACES, SETTLED, STEPS, cell, field, refused, takers, truth_of


def figure(name: str, runs: range) -> Figure:
    """A column for each field: where the target was and where it was taken to be; how far off, over time."""
    taken = [one for one in FIELDS if not refused(name, field(one))]
    colour = tracker_colours([name])[name]
    drawn = Figure(figsize=(2.3 * max(len(taken), 2), 4.4), layout="constrained")
    axes = drawn.subplots(2, len(taken), squeeze=False, sharey="row", height_ratios=(3, 2))
    for one, (above, below) in zip(taken, axes.T, strict=True):
        found = cell(name, field(one), runs, alone=False)
        truth = truth_of(field(one), runs[0])[SETTLED:, :2]
        above.plot(*PLACES.T, ".", color=SOFT, ms=3)
        above.plot(*truth.T, color=TRUTH, lw=2.5, alpha=0.75, label="target")
        above.plot(*(truth + found.errors[0, :, :2]).T, color=colour, lw=1.2, label=name)
        above.set(title=one, xlabel="m", aspect="equal", xlim=(-15.0, 255.0), ylim=(-15.0, 255.0))
        steps = np.arange(SETTLED, STEPS + 1)
        error = np.sqrt(np.square(found.errors[..., :2]).sum(axis=-1).mean(axis=0))
        below.semilogy(steps, error, color=colour)
        below.semilogy(steps, np.sqrt(np.square(found.bounds).mean(axis=0)), "--", color=TRUTH, lw=1.0, label="bound")
        below.set(xlabel="step", ylim=(0.2, 200.0))
    axes[0, 0].set(ylabel="m")
    axes[1, 0].set(ylabel="error, m")
    axes[0, 0].legend(loc="upper left", frameon=True, framealpha=1.0, edgecolor="none")  # over sensors
    axes[1, 0].legend(loc="upper right", frameon=True, framealpha=1.0, edgecolor="none")
    return drawn


def main() -> None:
    """See the module's docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--trackers", nargs="*", default=takers())
    parser.add_argument("--out", type=Path, default=Path("docs/trackers"))
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    with mpl.rc_context({**STYLE, "axes.titlesize": 9, "legend.fontsize": 7, "font.size": 8, "savefig.dpi": 80}):
        for name in given.trackers:
            figure(name, range(given.runs)).savefig(given.out / f"{name}.png")


if __name__ == "__main__":
    main()
