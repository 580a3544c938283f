"""The command line, ``trackfield``."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated, NoReturn

import typer

from launcher.processes.garbage import look_seldom
from trackfield.errors import ScenarioError, TrackfieldError

app = typer.Typer(
    name="trackfield",
    help="Emulates field deployments that track moving targets with networks of small sensors.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
)

Name = Annotated[str, typer.Argument(metavar="SCENARIO", help="A packaged scenario's name, or a TOML file.")]
Set = Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Override a key, as link.loss=0.1.")]
Target = Annotated[Path | None, typer.Option("--target", help="The target's track: a GPX or CSV file.")]
From = Annotated[str | None, typer.Option("--from", help="Start of the window in the track, in the file's zone.")]
To = Annotated[str | None, typer.Option("--to", help="End of the window.")]
Sensors = Annotated[Path | None, typer.Option("--sensors", help="Where the sensors stand: a CSV file.")]
Nodes = Annotated[int | None, typer.Option(help="About how many sensors, at the scenario's own spacing.")]
LinkModel = Annotated[str | None, typer.Option("--link", help="The link model, with its default parameters.")]
Trackers = Annotated[list[str] | None, typer.Option("--tracker", help="A tracker to run; may be repeated.")]


@app.command()
def run(
    scenario: Name,
    seed: Annotated[
        int | None, typer.Option(help="Decides every random draw; the scenario's own if not given.")
    ] = None,
    speed: Annotated[float, typer.Option(help="Emulated seconds per second.")] = 1.0,
    virtual: Annotated[bool, typer.Option("--virtual", help="In virtual time, in one process.")] = False,
    overrides: Set = None,
    target: Target = None,
    start: From = None,
    end: To = None,
    sensors: Sensors = None,
    nodes: Nodes = None,
    link: LinkModel = None,
    tracker: Trackers = None,
    out: Annotated[Path | None, typer.Option(help="The run folder; new or empty.")] = None,
    live: Annotated[bool, typer.Option("--live", help="Show the run in the browser while it goes on.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print metrics.json, and nothing else, to stdout.")] = False,
    connect: Annotated[str, typer.Option(help="Use the Zenoh router at this endpoint.")] = "",
    external: Annotated[
        bool, typer.Option("--external", help="Wait for processes that start elsewhere and join through --connect.")
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress.")] = False,
) -> None:
    """Run a scenario and leave a run folder with its timeline, tables and metrics."""
    from launcher.options import check_driver, check_endpoint
    from launcher.plan.prepare import load, planned
    from launcher.record.folder import keep, prepare_folder
    from launcher.run import run_processes, run_virtual
    from launcher.show import announce, conclude, observing, tell

    resolved = load(
        scenario,
        settings=overrides or (),
        seed=seed,
        target=target,
        start=start,
        end=end,
        sensors=sensors,
        nodes=nodes,
        link=link,
        trackers=tracker or (),
    )
    plan = planned(resolved, speed)
    if connect:
        check_endpoint(connect, "--connect")
    check_driver(virtual=virtual, external=external, live=live, connect=connect)
    folder = prepare_folder(out, resolved.name, resolved.seed)
    keep(resolved, folder)
    if not quiet:
        announce(plan)
    if virtual:
        outcome = run_virtual(plan, folder, sys.argv)
    else:
        with observing(plan, quiet=quiet) as observer:
            live_to = tell if live else None
            outcome = run_processes(plan, folder, observer, sys.argv, connect, external=external, live=live_to)
    if as_json:
        print(json.dumps(outcome.metrics, indent=2))
    if not quiet or outcome.complaints or outcome.unreported:
        conclude(outcome)
    raise typer.Exit(outcome.exit_code)


@app.command()
def replay(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="The folder of a finished run.")],
    tracker: Trackers = None,
    drop_late: Annotated[bool, typer.Option("--drop-late", help="Without the reports that came late.")] = False,
    out: Annotated[Path | None, typer.Option(help="The replay's own folder; new or empty.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print metrics.json, and nothing else, to stdout.")] = False,
) -> None:
    """Fuse the reports of a run again, by other trackers (or its own), into a folder of their own."""
    from launcher.show import conclude, note
    from launcher.study.replay import caveats
    from launcher.study.replay import replay as fuse

    outcome = fuse(run, tracker or (), drop_late=drop_late, out=out, command=sys.argv)
    if as_json:
        print(json.dumps(outcome.metrics, indent=2))
    for caveat in caveats(outcome.metrics):
        note(caveat)
    conclude(outcome)
    raise typer.Exit(outcome.exit_code)


@app.command()
def router(
    listen: Annotated[
        list[str], typer.Option(metavar="ENDPOINT", help="Where, like tcp/0.0.0.0:7447; may be repeated.")
    ],
) -> None:
    """Be a router for runs whose processes start elsewhere, until Ctrl-C."""
    from launcher.options import check_endpoint
    from launcher.processes.router import serve

    for endpoint in listen:
        check_endpoint(endpoint, "--listen")
    serve(listen)


@app.command("list")
def list_scenarios(
    schema: Annotated[
        bool, typer.Option("--schema", help="Print the JSON schema of scenario files, for editors.")
    ] = False,
) -> None:
    """List the packaged scenarios, the trackers and the kinds of sensors."""
    from trackfield import scenario
    from trackfield.filters.trackers import TRACKERS
    from trackfield.world.sensors import SENSORS

    if schema:
        print(json.dumps(scenario.schema(), indent=2))
        return
    for name in scenario.names():
        print(f"{name:12} {scenario.summary(name)}")
    print(f"trackers: {', '.join(TRACKERS)}")
    print(f"sensors: {', '.join(SENSORS)}")


@app.command()
def validate(scenario: Name, overrides: Set = None, sensors: Sensors = None) -> None:
    """Check a scenario and say what it comes to."""
    from launcher.plan.prepare import load, planned
    from launcher.show import announce, foresee

    plan = planned(load(scenario, settings=overrides or (), sensors=sensors))
    announce(plan)
    foresee(plan)


@app.command()
def view(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="A run folder.")],
    web: Annotated[bool, typer.Option("--web", help="In the browser.")] = False,
    png: Annotated[Path | None, typer.Option(help="Write a picture of the timeline instead, without a screen.")] = None,
    at: Annotated[float | None, typer.Option(help="The emulated second that the picture shows.")] = None,
) -> None:
    """Open a run's timeline."""
    from launcher.timeline.view import open_viewer, picture

    if png is None:
        open_viewer(run, web)
    else:
        picture(run, png, at)


@app.command()
def report(run: Annotated[Path, typer.Argument(metavar="RUN", help="The folder of a finished run.")]) -> None:
    """Draw a run's figures and write its report.html, anew."""
    from launcher.report import write_report

    print(write_report(run))


@app.command()
def compare(
    runs: Annotated[list[Path], typer.Argument(metavar="RUN RUN...", help="Run folders.")],
    exact: Annotated[
        float | None,
        typer.Option(
            metavar="TOL",
            min=0.0,
            help="Fail unless tracks are equal to within this, and the fate of every frame is the same.",
        ),
    ] = None,
) -> None:
    """Show runs side by side, or whether they are the same."""
    from rich.console import Console

    from launcher.study.compare import check_runs, differences
    from launcher.study.side_by_side import side_by_side

    if len(runs) < 2:
        raise ScenarioError("there is nothing to compare it with", key="RUN", expected="two run folders or more")
    check_runs(runs)
    Console(markup=False, emoji=False).print(side_by_side(runs))
    if exact is None:
        return
    found = [f"{other}: {what}" for other in runs[1:] for what in differences(runs[0], other, exact)]
    for line in found:
        print(line, file=sys.stderr)
    if found:
        raise typer.Exit(1)
    print(f"equal to within {exact:g}, and the fate of every frame is the same")


@app.command()
def reproduce(
    paper: Annotated[str, typer.Argument(metavar="PAPER", help="zhai: Zhai et al. 2009, SP-CPF.")],
    runs: Annotated[int, typer.Option(help="Of each case, with seeds from 1 on.")] = 100,
    out: Annotated[
        Path | None, typer.Option(help="The study's folder; what an earlier one left there is not run again.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print results.json, and nothing else, to stdout.")] = False,
) -> None:
    """Do a paper's experiments again, and say which of its claims hold."""
    from launcher.reproduce.command import reproduce

    print(reproduce(paper, runs, out).shown(as_json=as_json), end="")


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
