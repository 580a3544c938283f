"""The figures of Yang et al. (2009), drawn from their closed forms and from our runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import matplotlib as mpl

from launcher.report.style import STYLE
from launcher.reproduce.kernels.study import Found
from launcher.reproduce.papers.yang.figures import camera, closed, heard, runs, sweeps
from launcher.reproduce.papers.yang.whole.roles import done

LOOKS: Final[dict[Any, Any]] = {**STYLE, "axes.titlesize": 9, "figure.titlesize": 9, "legend.fontsize": 8}


def draw(folder: Path, found: Found) -> None:
    """Write all of them into ``folder``."""
    with mpl.rc_context(LOOKS):
        for name, one in (
            ("fig02", closed.fig02()),
            ("fig03", closed.fig03()),
            ("fig04", closed.fig04()),
            ("fig08", closed.fig08()),
            ("fig10", heard.fig10()),
            ("fig13", sweeps.fig13(found)),
            ("fig14", sweeps.fig14(found)),
            ("fig15", sweeps.fig15(found)),
            ("fig16", sweeps.fig16(found)),
            ("camera", camera.camera(found)),
        ):
            one.savefig(folder / f"{name}.png")
        if done(found):
            runs.fig12(found).savefig(folder / "fig12.png")
