"""Whom each process of a run asks for the time: references form trees, whose roots ask nobody."""

from __future__ import annotations

from collections.abc import Mapping

from trackfield.errors import ScenarioError
from trackfield.words import quoted

_EXPECTED = "references that lead from each process to one that asks nobody"


def check_references(references: Mapping[str, str | None], key: str) -> None:
    """Raise ``ScenarioError`` if one of them is not there, or if processes ask each other in a circle."""
    sound = set[str]()
    for start in references:
        way: dict[str, None] = {}
        at: str | None = start
        while at is not None and at not in sound:
            if at not in references:
                raise ScenarioError(f"{list(way)[-1]} asks {quoted(at)} for the time, which is not there", key=key)
            if at in way:
                circle = " asks ".join([*list(way)[list(way).index(at) :], at])
                what = f"{circle} for the time, so none of them ever learns it"
                raise ScenarioError(what, key=key, expected=_EXPECTED)
            way[at] = None
            at = references[at]
        sound.update(way)
