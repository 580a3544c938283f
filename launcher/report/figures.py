"""All figures of a report: drawn, and written into ``plots/``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

import matplotlib
from matplotlib.figure import Figure

from launcher.report.folder import Run
from launcher.report.parts.field import field
from launcher.report.parts.series import error, nees
from launcher.report.parts.traffic import latency, losses
from launcher.report.style import STYLE

PLOTS: Final = "plots"
FIGURES: Final[Mapping[str, Callable[[Run], Figure | None]]] = {
    "field": field,
    "error": error,
    "nees": nees,
    "losses": losses,
    "latency": latency,
}
"""By name; None where there is nothing to show."""


def draw(run: Run) -> dict[str, Path]:
    """Write ``plots/<name>.png`` into the run folder, anew; the files by name."""
    folder = run.folder / PLOTS
    folder.mkdir(exist_ok=True)
    drawn = {}
    with matplotlib.rc_context():
        matplotlib.rcParams.update(STYLE)
        for name, make in FIGURES.items():
            file = folder / f"{name}.png"
            figure = make(run)
            if figure is None:
                file.unlink(missing_ok=True)
            else:
                figure.savefig(file)
                drawn[name] = file
    return drawn
