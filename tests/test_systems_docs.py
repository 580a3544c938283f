"""docs/systems.md says of each claim what the page with its figures says."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from trackfield.scenario.packaged import names

DOCS = Path(__file__).parents[1] / "docs"
VERDICT = "holds|holds in part|does not hold|too few runs to tell"
PAGES = {
    "zhai-spcpf": ("papers",),
    "ozfidan-clusters": ("papers-ozfidan",),
    "yu-mrbpf": ("papers", "papers-yu"),
    "zhou-upf": ("papers", "papers-zhou"),
    "yang-ecpa": ("papers-yang",),
}
"""Where the claims about each system are."""


def rows(text: str) -> dict[str, str]:
    """The verdicts of the tables of a page by the claim, their first column."""
    found = re.findall(rf"^\| ([^|]+?) +\|.* ({VERDICT}) \|$|^\| ([^|]+?) \| ({VERDICT}) \|$", text, re.MULTILINE)
    return {a or c: b or d for a, b, c, d in found}


def parts() -> dict[str, str]:
    """The page of each system, by its scenario."""
    _, *found = re.split(r"^## `([a-z-]+)`.*$", (DOCS / "systems.md").read_text(), flags=re.MULTILINE)
    return dict(zip(found[::2], found[1::2], strict=True))


def test_every_system_is_there() -> None:
    assert set(parts()) == set(PAGES) <= set(names())


@pytest.mark.parametrize("scenario", sorted(PAGES))
def test_verdicts_are_those_of_the_page_with_the_figures(scenario: str) -> None:
    known: dict[str, str] = {}
    for page in PAGES[scenario]:
        known |= rows((DOCS / f"{page}.md").read_text())
    told = rows(parts()[scenario])
    assert len(told) >= 4
    assert told == {claim: known.get(claim) for claim in told}


@pytest.mark.parametrize("scenario", sorted(PAGES))
def test_what_does_not_hold_is_not_left_out(scenario: str) -> None:
    """Of the paper's own claims about the whole system and its filters."""
    told = rows(parts()[scenario])
    for page in PAGES[scenario]:
        own = rows((DOCS / f"{page}.md").read_text())
        if page != "papers":
            failed = {claim for claim, verdict in own.items() if verdict == "does not hold"}
            assert {claim for claim in failed if not claim.lower().startswith("(not in the paper)")} <= told.keys()
