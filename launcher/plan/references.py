"""Whom each process of a run asks for the time: references form trees, whose roots ask nobody."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from trackfield.drivers.spec import ProcessSpec
from trackfield.errors import ScenarioError
from trackfield.words import quoted

_EXPECTED = "references that lead from each process to one that asks nobody"


def references_of(processes: Iterable[ProcessSpec]) -> dict[str, str | None]:
    """The reference of each process, by the ``sync`` of its role; None if it asks nobody."""
    return {process.id: _reference(process) for process in processes}


def _reference(process: ProcessSpec) -> str | None:
    match process.config.get("sync"):
        case {"reference": str(reference)}:
            return reference
    return None


def check_references(references: Mapping[str, str | None]) -> None:
    """Raise ``ScenarioError`` if one of them is not there, or if processes ask each other in a circle."""
    sound = set[str]()
    for start in references:
        way: dict[str, None] = {}
        at: str | None = start
        while at is not None and at not in sound:
            if at not in references:
                what = f"{list(way)[-1]} asks {quoted(at)} for the time, which is not there"
                raise ScenarioError(what, key="architecture")
            if at in way:
                circle = " asks ".join([*list(way)[list(way).index(at) :], at])
                what = f"{circle} for the time, so none of them ever learns it"
                raise ScenarioError(what, key="architecture", expected=_EXPECTED)
            way[at] = None
            at = references[at]
        sound |= way.keys()
