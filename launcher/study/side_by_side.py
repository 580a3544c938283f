"""Runs side by side, for a terminal."""

from __future__ import annotations

from typing import Final

from rich.console import Console
from rich.table import Table
from rich.text import Text

from launcher.study.comparison.remarks import remarks
from launcher.study.comparison.rows import Group, figures, settings
from launcher.study.comparison.runs import Compared

LONGEST: Final = 40
"""Characters of a scenario's value that are shown."""


def show(compared: Compared, console: Console | None = None) -> None:
    """Print the table, and remarks that matter for the comparison."""
    to = console or Console(markup=False, emoji=False, highlight=False)
    to.print(side_by_side(compared))
    for remark in remarks(compared):
        to.print(f"note: {remark}")


def side_by_side(compared: Compared) -> Table:
    """What differs between the scenarios, then the figures: a column per run; the best figure of a row is bold."""
    table = Table()
    table.add_column("", no_wrap=True)
    for name in compared.names:
        table.add_column(Text(name), justify="right", overflow="fold")
    for group in (settings(compared), *figures(compared)):
        _add(table, group)
    return table


def _add(table: Table, group: Group) -> None:
    if not group.rows:
        return
    table.add_row(Text(group.title, style="bold"))
    for row in group.rows:
        cells = zip(row.said, row.best, strict=True)
        table.add_row(
            Text(f"  {row.name}"), *(Text(_short(text), style="bold" if best else "") for text, best in cells)
        )
    table.add_section()


def _short(value: str) -> str:
    return value if len(value) <= LONGEST else f"{value[: LONGEST - 4]} ..."
