"""All figures of a report: drawn, and written into ``plots/``."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Final

import matplotlib

from launcher.report.folder import Run
from launcher.report.parts import PARTS
from launcher.report.style import STYLE, Figures

PLOTS: Final = "plots"
FIGURES: Final[Figures] = {name: draw for part in PARTS.values() for name, draw in part.FIGURES.items()}
"""The figures of all parts, by name."""


def draw(run: Run, names: Collection[str] = FIGURES.keys()) -> dict[str, Path]:
    """Write ``plots/<name>.png`` into the run folder, over earlier ones, for these names; the files by name."""
    folder = run.folder / PLOTS
    folder.mkdir(exist_ok=True)
    drawn = {}
    with matplotlib.rc_context():
        matplotlib.rcParams.update(STYLE)
        for name in names:
            file = folder / f"{name}.png"
            figure = FIGURES[name](run)
            if figure is None:
                file.unlink(missing_ok=True)
            else:
                figure.savefig(file)
                drawn[name] = file
    return drawn
