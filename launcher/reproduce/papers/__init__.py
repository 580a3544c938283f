"""The papers that are reproduced, a folder for each: cases, bands, claims, figures."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from trackfield.errors import ScenarioError
from trackfield.plugins import load
from trackfield.scenario.nearest import suggestion

if TYPE_CHECKING:
    from launcher.reproduce.kernels.study import Kernels
    from launcher.reproduce.paper import Paper

PAPERS: Final = {"zhai": "launcher.reproduce.papers.zhai:PAPER"}
"""Where the runs of whole systems of each are, by name."""
KERNELS: Final = {
    "ozfidan": "launcher.reproduce.papers.ozfidan:KERNELS",
    "yang": "launcher.reproduce.papers.yang:KERNELS",
    "yu": "launcher.reproduce.papers.yu:KERNELS",
    "zhou": "launcher.reproduce.papers.zhou:KERNELS",
}
"""Where the experiments on bare filters of each are, by name; one may hold experiments with roles besides."""


def names() -> list[str]:
    """Of all papers."""
    return sorted({*PAPERS, *KERNELS})


def paper_named(name: str) -> Paper[Any]:
    """The paper of this name; raises ``ScenarioError`` if there is none, or only its bare filters."""
    _check(name)
    if name not in PAPERS:
        what = f"of '{name}' there are experiments on bare filters only, without roles and messages"
        raise ScenarioError(what, key="PAPER", expected=f"{name} --kernels")
    paper: Paper[Any] = load(PAPERS[name])
    return paper


def kernels_named(name: str) -> Kernels:
    """The experiments on bare filters of the paper of this name; raises ``ScenarioError`` if there are none."""
    _check(name)
    if name not in KERNELS:
        what = f"of '{name}' there are runs of the whole system only, no experiments on bare filters"
        raise ScenarioError(what, key="--kernels", expected=f"{name} without it, or one of {', '.join(KERNELS)}")
    kernels: Kernels = load(KERNELS[name])
    return kernels


def holds_roles(name: str) -> bool:
    """Whether experiments with roles are beside those on bare filters: then they are the whole study of the paper.

    Raises ``ScenarioError`` for an unknown paper.
    """
    _check(name)
    return name in KERNELS and kernels_named(name).with_roles


def _check(name: str) -> None:
    if name not in names():
        what = f"unknown paper {name!r}{suggestion(name, names())}"
        raise ScenarioError(what, key="PAPER", expected=f"one of {', '.join(names())}")
