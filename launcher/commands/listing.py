"""``list``."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Annotated, Final

import typer

from launcher.commands import choices
from trackfield.errors import ScenarioError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from launcher.commands.kinds import Item

WIDTH: Final = 160
"""Width of the output, in characters, where there is no terminal."""


def list_kinds(
    kind: Annotated[
        str | None,
        typer.Argument(
            metavar="KIND", autocompletion=choices.completed(choices.kinds), help="What to describe: {kinds}."
        ),
    ] = None,
    schema: Annotated[
        bool, typer.Option("--schema", help="Print the JSON schema of scenario files, for editors.")
    ] = False,
) -> None:
    """List the packaged scenarios, trackers, links and more; with a KIND, say what each is and its parameters."""
    from launcher.commands.kinds import KINDS
    from trackfield import scenario
    from trackfield.scenario.nearest import suggestion

    if schema:
        print(json.dumps(scenario.schema(), indent=2))
    elif kind is None:
        _overview()
    elif kind in KINDS:
        _print(KINDS[kind]())
    else:
        what = f"unknown kind {kind!r}{suggestion(kind, KINDS)}"
        raise ScenarioError(what, key="KIND", expected=f"one of {', '.join(KINDS)}")


def _overview() -> None:
    """The scenarios with their summaries, all else by name."""
    from launcher.commands.kinds import KINDS, Item

    _print(KINDS["scenarios"]())
    print()
    others = [name for name in KINDS if name != "scenarios"]
    _print(Item(name, ", ".join(item.name for item in KINDS[name]())) for name in others)
    print("\nWhat each is, and its parameters: trackfield list KIND, like trackfield list trackers")


def _print(items: Iterable[Item]) -> None:
    """A line for each, its parameters below it; several where they do not fit."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    terminal = Console(markup=False, emoji=False, highlight=False)
    console = terminal if terminal.is_terminal else Console(width=WIDTH)
    table = Table.grid(padding=(0, 2), pad_edge=False)
    table.add_column(style="bold", no_wrap=True)
    table.add_column()
    for item in items:
        below = Text(f"\n{item.parameters}" if item.parameters else "", style="dim")
        table.add_row(item.name, Text(item.what).append_text(below))
    with console.capture() as text:
        console.print(table)
    for line in text.get().splitlines():
        print(line.rstrip())
