"""The command line, ``trackfield``."""

from __future__ import annotations

import sys
from typing import NoReturn

import typer

from launcher.commands import compare, listing, replay, reproduce, router, run, study, validate, view
from launcher.processes.garbage import look_seldom
from trackfield.errors import ScenarioError, TrackfieldError

app = typer.Typer(
    name="trackfield",
    help="Emulates field deployments that track moving targets with networks of small sensors.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
)
app.command("run")(run.run)
app.command("replay")(replay.replay)
app.command("router")(router.router)
app.command("list")(listing.list_scenarios)
app.command("validate")(validate.validate)
app.command("view")(view.view)
app.command("report")(view.report)
app.command("compare")(compare.compare)
app.command("study")(study.study)
app.command("reproduce")(reproduce.reproduce)


def main() -> NoReturn:
    """The program: exit 2 with one message for bad input, 1 for a failed run, never a traceback for either."""
    look_seldom()
    try:
        raise SystemExit(app(prog_name="trackfield", standalone_mode=False))
    except typer.TyperException as error:  # an unknown or incomplete command or option
        context = getattr(error, "ctx", None)
        command = context.command_path if context else "trackfield"
        if message := error.format_message().rstrip("."):
            _end(f"{message}; see {command} --help", 2)
        raise SystemExit(2) from None  # nothing was asked for, and typer has shown the help
    except ScenarioError as error:
        _end(str(error), 2)
    except TrackfieldError as error:
        _end(str(error), 1)


def _end(message: str, code: int) -> NoReturn:
    print(f"trackfield: {message}", file=sys.stderr)
    raise SystemExit(code)


if __name__ == "__main__":
    main()
