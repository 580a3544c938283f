"""The request for a run: the arguments and options that ``run`` and ``validate`` share."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, get_type_hints

import typer

from launcher.commands.arguments import End, LinkModel, Name, Nodes, Sensors, Set, Start, Target, Trackers

if TYPE_CHECKING:
    from launcher.records import Plan
    from trackfield.scenario import Scenario


@dataclass(frozen=True)
class Request:
    """A scenario, what is changed in it, and how it is to be run; each field is an option of the command line."""

    scenario: Name
    seed: Annotated[int | None, typer.Option(help="The seed of every random draw; unset: the scenario's own.")] = None
    speed: Annotated[
        float | None, typer.Option(help="Emulated seconds per second of real time, for a run over processes.")
    ] = None
    virtual: Annotated[bool, typer.Option("--virtual", help="Run in virtual time, in a single process.")] = False
    overrides: Set = None
    target: Target = None
    start: Start = None
    end: End = None
    sensors: Sensors = None
    nodes: Nodes = None
    link: LinkModel = None
    tracker: Trackers = None
    out: Annotated[Path | None, typer.Option(help="The run folder; new or empty.")] = None
    live: Annotated[bool, typer.Option("--live", help="Show the run in the browser while it goes on.")] = False
    as_json: Annotated[bool, typer.Option("--json", help="Print the figures as JSON, and nothing else, to stdout.")] = (
        False
    )
    connect: Annotated[
        str,
        typer.Option(metavar="ENDPOINT", help="Use the Zenoh router at this endpoint, like tcp/127.0.0.1:7447."),
    ] = ""
    external: Annotated[
        bool,
        typer.Option("--external", help="Wait for processes that start elsewhere and join at the router of --connect."),
    ] = False
    quiet: Annotated[bool, typer.Option("--quiet", help="Print errors only.")] = False

    def prepared(self) -> tuple[Scenario, Plan]:
        """The scenario and its plan. Raises ``ScenarioError`` with all that is wrong with this request."""
        from launcher.options import check_driver, check_endpoint, check_viewer
        from launcher.plan.prepare import prepare
        from launcher.record.folder import check_folder

        prepared = prepare(
            self.scenario,
            1.0 if self.speed is None else self.speed,
            [
                partial(
                    check_driver,
                    virtual=self.virtual,
                    external=self.external,
                    live=self.live,
                    connect=self.connect,
                    speed=self.speed,
                ),
                *([partial(check_endpoint, self.connect, "--connect")] if self.connect else []),
                *([partial(check_folder, self.out)] if self.out else []),
            ],
            settings=self.overrides or (),
            seed=self.seed,
            target=self.target,
            start=self.start,
            end=self.end,
            sensors=self.sensors,
            nodes=self.nodes,
            link=self.link,
            trackers=self.tracker or (),
        )
        if self.live:
            check_viewer()
        return prepared


def command(body: Callable[[Request], None]) -> Callable[..., None]:
    """A command of the command line that takes all options of a ``Request``."""

    def call(**options: object) -> None:
        body(Request(**options))  # type: ignore[arg-type]

    call.__name__, call.__doc__ = body.__name__, body.__doc__
    call.__annotations__ = get_type_hints(Request, include_extras=True)
    call.__signature__ = inspect.signature(Request, eval_str=True)  # type: ignore[attr-defined]
    return call
