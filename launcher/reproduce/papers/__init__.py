"""The papers that are reproduced, a folder for each: cases, bands, claims, figures."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from trackfield.errors import ScenarioError
from trackfield.plugins import load
from trackfield.scenario.nearest import suggestion

if TYPE_CHECKING:
    from launcher.reproduce.paper import Paper

PAPERS: Final = {"zhai": "launcher.reproduce.papers.zhai:PAPER"}
"""Where each is, by name."""


def paper_named(name: str) -> Paper[Any]:
    """The paper of this name; raises ``ScenarioError`` if there is none."""
    if name not in PAPERS:
        what = f"unknown paper {name!r}{suggestion(name, PAPERS)}"
        raise ScenarioError(what, key="PAPER", expected=f"one of {', '.join(PAPERS)}")
    paper: Paper[Any] = load(PAPERS[name])
    return paper
