"""Zhou, Cheng & Liang (2011): an unscented particle filter on the distances that clusters of three nodes measure."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from launcher.reproduce.kernels.study import Found, Kernels
from launcher.reproduce.papers.zhou.claims import claims
from launcher.reproduce.papers.zhou.experiments import EXPERIMENTS, times
from launcher.reproduce.papers.zhou.tables import tables
from launcher.reproduce.papers.zhou.words import FIGURES, parts


def _draw(folder: Path, found: Found) -> None:
    from launcher.reproduce.papers.zhou.figures import draw  # matplotlib with it

    draw(folder, found)


KERNELS: Final = Kernels(
    name="zhou",
    title="Zhou et al. 2011, UPF",
    experiments=EXPERIMENTS,
    tables=tables,
    claims=claims,
    parts=parts,
    figures=FIGURES,
    draw=_draw,
    times=times,
)
