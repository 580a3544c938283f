"""Yu, You, Wei & Liu (2009): multi-model Rao-Blackwellised particle filter, by acoustic energy; bare filters."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from launcher.reproduce.kernels.study import Found, Kernels
from launcher.reproduce.papers.yu.claims import claims
from launcher.reproduce.papers.yu.experiments import EXPERIMENTS
from launcher.reproduce.papers.yu.tables import tables
from launcher.reproduce.papers.yu.words import FIGURES, parts


def _draw(folder: Path, found: Found) -> None:
    from launcher.reproduce.papers.yu.figures import draw  # matplotlib with it

    draw(folder, found)


KERNELS: Final = Kernels(
    name="yu",
    title="Yu et al. 2009, MRBPF",
    experiments=EXPERIMENTS,
    tables=tables,
    claims=claims,
    parts=parts,
    figures=FIGURES,
    draw=_draw,
)
