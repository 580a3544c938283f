"""Zhou, Cheng & Liang (2011): an unscented particle filter on the distances that clusters of three nodes measure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from launcher.reproduce.kernels.study import Found, Kernels
from launcher.reproduce.papers.zhou import claims, roles, tables, whole_claims, whole_tables, words
from launcher.reproduce.papers.zhou.experiments import EXPERIMENTS, times
from launcher.reproduce.tables import Claim, Row


def _draw(folder: Path, found: Found) -> None:
    from launcher.reproduce.papers.zhou.figures import draw  # matplotlib with it

    draw(folder, found)


def _tables(found: Found) -> Mapping[str, Sequence[Row]]:
    return {**tables.tables(found), **whole_tables.tables(found)}


def _claims(found: Found) -> list[Claim]:
    return [*claims.claims(found), *whole_claims.claims(found)]


def _parts(found: Found) -> list[tuple[str, str]]:
    return [*words.parts(found), *whole_tables.parts(found)]


KERNELS: Final = Kernels(
    name="zhou",
    title="Zhou et al. 2011, UPF",
    experiments={**EXPERIMENTS, **roles.EXPERIMENTS},
    tables=_tables,
    claims=_claims,
    parts=_parts,
    figures=words.FIGURES,
    draw=_draw,
    times=times,
    with_roles=True,
)
