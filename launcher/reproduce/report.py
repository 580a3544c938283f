"""The report of a study, as Markdown."""

from __future__ import annotations

from launcher.reproduce.paper import Paper
from launcher.reproduce.scores import Results, S
from launcher.reproduce.tables import READING, aligned, claims_table


def markdown(paper: Paper[S], results: Results[S]) -> str:
    """The claims, the paper's own parts, and what the figures show."""
    parts = [
        ("Claims", f"{READING}\n\n{claims_table(paper.claims(results))}"),
        *paper.parts(results),
        ("Figures", aligned(("file", "shows", "the paper has"), paper.figures)),
    ]
    return "\n\n".join(f"## {heading}\n\n{text}" for heading, text in parts) + "\n"
