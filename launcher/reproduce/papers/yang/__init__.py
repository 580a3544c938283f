"""Yang, Lim, Casey & Neelisetti (2009): the path of a vehicle from the times at which five sensors hear it pass."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isnan
from pathlib import Path
from typing import Final

from launcher.reproduce.kernels.study import Found, Kernels
from launcher.reproduce.papers.yang import claims, words
from launcher.reproduce.papers.yang.camera import claims as camera_claims
from launcher.reproduce.papers.yang.camera import tables as camera_tables
from launcher.reproduce.papers.yang.camera import whole as camera_whole
from launcher.reproduce.papers.yang.experiments import EXPERIMENTS
from launcher.reproduce.papers.yang.solved.costs import times
from launcher.reproduce.papers.yang.sound import end_to_end_claim
from launcher.reproduce.papers.yang.whole import roles
from launcher.reproduce.papers.yang.whole import tables as whole_tables
from launcher.reproduce.tables import Claim, Row


def _draw(folder: Path, found: Found) -> None:
    from launcher.reproduce.papers.yang.figures import draw  # matplotlib with it

    draw(folder, found)


def _tables(found: Found) -> Mapping[str, Sequence[Row]]:
    every = {**words.tables(found), **whole_tables.tables(found), **camera_tables.tables(found)}
    return {name: [row for row in rows if not isnan(row.ours.value)] for name, rows in every.items()}


def _claims(found: Found) -> list[Claim]:
    return [*claims.claims(found), end_to_end_claim(found), *whole_tables.claims(found), *camera_claims.claims(found)]


def _parts(found: Found) -> list[tuple[str, str]]:
    return [*words.parts(found), *whole_tables.parts(found), *camera_tables.parts(found)]


KERNELS: Final = Kernels(
    name="yang",
    title="Yang et al. 2009, ECPA",
    experiments={**EXPERIMENTS, **roles.EXPERIMENTS, **camera_whole.EXPERIMENTS},
    tables=_tables,
    claims=_claims,
    parts=_parts,
    figures=words.FIGURES,
    draw=_draw,
    times=times,
    with_roles=True,
)
