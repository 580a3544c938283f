"""Özfidan et al. (2018): clusters of sensors that are woken where a target is, by a master that leads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from launcher.reproduce.kernels.study import Found, Kernels
from launcher.reproduce.papers.ozfidan import energies, roles, tables
from launcher.reproduce.papers.ozfidan.claims import claims
from launcher.reproduce.papers.ozfidan.experiments import EXPERIMENTS
from launcher.reproduce.papers.ozfidan.words import FIGURES, parts
from launcher.reproduce.tables import Row


def _draw(folder: Path, found: Found) -> None:
    from launcher.reproduce.papers.ozfidan.figures import draw  # matplotlib with it

    draw(folder, found)


def _tables(found: Found) -> Mapping[str, Sequence[Row]]:
    return {**tables.tables(found), **energies.tables(found)}


KERNELS: Final = Kernels(
    name="ozfidan",
    title="Özfidan et al. 2018, clusters",
    experiments={**EXPERIMENTS, **roles.EXPERIMENTS},
    tables=_tables,
    claims=claims,
    parts=parts,
    figures=FIGURES,
    draw=_draw,
    with_roles=True,
)
