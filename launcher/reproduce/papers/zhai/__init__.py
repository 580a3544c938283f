"""Zhai, Yeary, Havlicek & Fan (2009): state-partition centralised particle filter, by sound level and direction."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from launcher.reproduce.paper import Paper
from launcher.reproduce.papers.zhai.cases import ALL, CASES
from launcher.reproduce.papers.zhai.claims import claims
from launcher.reproduce.papers.zhai.contrasts import contrasts
from launcher.reproduce.papers.zhai.tables import tables
from launcher.reproduce.papers.zhai.words import FIGURES, parts
from launcher.reproduce.records import Records
from launcher.reproduce.scores import Results, Score, usual_scores


def _draw(folder: Path, records: Records, results: Results[Score]) -> dict[str, int]:
    from launcher.reproduce.papers.zhai.figures import draw  # matplotlib with it

    return draw(folder, records, results)


PAPER: Final = Paper(
    name="zhai",
    title="Zhai et al. 2009, SP-CPF",
    cases=CASES,
    scores=usual_scores,
    contrasts=contrasts,
    tables=tables,
    claims=claims,
    parts=parts,
    figures=FIGURES,
    draw=_draw,
    run=CASES["s1"].only(*ALL),
    timed=CASES["s1"].only("spcpf", "bootstrap", "fix-imm-ukf", "ekf", "ukf", "fix-doa"),
)
