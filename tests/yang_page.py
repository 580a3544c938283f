"""Puts the claims, tables and figures of a finished study into docs/papers-yang.md; the prose is written by hand.

trackfield reproduce yang --runs 500
python -m tests.yang_page runs/reproduce-yang
"""

from __future__ import annotations

import json
import shutil
import sys
from dataclasses import fields
from pathlib import Path
from typing import Any, Final

from launcher.reproduce.intervals import Interval
from launcher.reproduce.papers.yang import words
from launcher.reproduce.papers.yang.camera import tables as camera
from launcher.reproduce.papers.yang.whole import tables
from launcher.reproduce.tables import READING, Claim, Row, claims_table

DOCS: Final = Path(__file__).parents[1] / "docs"
PAGE: Final = DOCS / "papers-yang.md"
KEPT: Final = DOCS / "papers-yang"
FIGURES: Final = ("fig04", "fig10", "fig12", "fig13", "fig14", "fig15", "fig16", "camera")
_INTERVALS: Final = frozenset(field.name for field in fields(Row) if "Interval" in str(field.type))
_BEFORE: Final = f"## What it claims\n\n{READING}\n\n"
_TABLES: Final = "## Tables\n\n"


def rows(results: dict[str, Any], table: str) -> list[Row]:
    """The rows of a table of results.json; none if it is missing."""
    found = list[Row]()
    for row in results["tables"].get(table, ()):
        values: dict[str, Any] = {name: Interval(*it) if it and name in _INTERVALS else it for name, it in row.items()}
        found.append(Row(**values))
    return found


def claims(results: dict[str, Any]) -> str:
    """The table of claims."""
    return claims_table(Claim(**claim) for claim in results["claims"])


def parts(results: dict[str, Any]) -> dict[str, str]:
    """The text of every table by its heading."""
    times = {name: [took] for name, took in results["times"].items()}
    found = {title: words.text(name, rows(results, name), times) for name, title in words.TITLES.items()}
    found |= {title: tables.text(name, rows(results, name)) for name, title in tables.TITLES.items()}
    return found | {title: camera.text(name, rows(results, name)) for name, title in camera.TITLES.items()}


def written(page: str, results: dict[str, Any]) -> str:
    """The page with these results in place of those that it has."""
    before, _, after = page.partition(_BEFORE)
    prose = after.split("\n\n", 1)[1].split(_TABLES)[0]
    text = "\n\n".join(f"### {title}\n\n{some}" for title, some in parts(results).items())
    return f"{before}{_BEFORE}{claims(results)}\n\n{prose}{_TABLES}{text}\n"


def main(folder: Path) -> None:
    """Copy the results and figures of the study in ``folder``, and write the page."""
    results = json.loads((folder / "results.json").read_text())
    results["command"][0] = "trackfield"
    KEPT.mkdir(exist_ok=True)
    (KEPT / "results.json").write_text(json.dumps(results, indent=2) + "\n")
    for name in FIGURES:
        shutil.copy(folder / "figures" / f"{name}.png", KEPT)
    PAGE.write_text(written(PAGE.read_text(), results))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
