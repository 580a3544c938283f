"""``recover``."""

from __future__ import annotations

import typer

from launcher.commands.arguments import Unfinished


def recover(run: Unfinished) -> None:
    """Make the tables, figures, timeline and report of a run that was cut off before it had written them."""
    from launcher.show import conclude
    from launcher.study.recover import recover as make

    outcome = make(run)
    conclude(outcome)
    raise typer.Exit(outcome.exit_code)
