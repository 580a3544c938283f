"""Yu, You, Wei & Liu (2009): multi-model Rao-Blackwellised particle filter, by acoustic energy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from launcher.reproduce.kernels.study import Found, Kernels
from launcher.reproduce.papers.yu import claims as bare
from launcher.reproduce.papers.yu import dimension, judged, lifetimes, messages, roles, tables
from launcher.reproduce.papers.yu.experiments import EXPERIMENTS
from launcher.reproduce.papers.yu.words import FIGURES, parts
from launcher.reproduce.tables import Claim, Row


def _draw(folder: Path, found: Found) -> None:
    from launcher.reproduce.papers.yu.figures import draw  # matplotlib with it

    draw(folder, found)


def _tables(found: Found) -> Mapping[str, Sequence[Row]]:
    return {**tables.tables(found), **messages.tables(found)}


def _claims(found: Found) -> Sequence[Claim]:
    return [*bare.claims(found), dimension.claim(found), *judged.claims(found)]


KERNELS: Final = Kernels(
    name="yu",
    title="Yu et al. 2009, MRBPF",
    experiments={**EXPERIMENTS, **dimension.EXPERIMENTS, **roles.EXPERIMENTS, **lifetimes.EXPERIMENTS},
    tables=_tables,
    claims=_claims,
    parts=parts,
    figures=FIGURES,
    draw=_draw,
    times=dimension.times,
    with_roles=True,
)
