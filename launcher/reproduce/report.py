"""The report of a study, as Markdown."""

from __future__ import annotations

from collections.abc import Sequence

from launcher.reproduce.paper import Paper
from launcher.reproduce.scores import Results, S
from launcher.reproduce.tables import READING, Claim, aligned, claims_table


def markdown(paper: Paper[S], results: Results[S]) -> str:
    """The claims, the paper's own parts, and what the figures show."""
    return written(paper.claims(results), paper.parts(results), paper.figures)


def written(claims: Sequence[Claim], parts: Sequence[tuple[str, str]], figures: Sequence[tuple[str, str, str]]) -> str:
    """The claims with their verdicts, ``parts`` (heading, text), and what the ``figures`` show."""
    every = [
        ("Claims", f"{READING}\n\n{claims_table(claims)}"),
        *parts,
        ("Figures", aligned(("file", "shows", "the paper has"), figures)),
    ]
    return "\n\n".join(f"## {heading}\n\n{text}" for heading, text in every) + "\n"
