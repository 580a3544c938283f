"""Requests for runs: the arguments and options of ``run``, ``validate`` and ``study``, as fields of dataclasses."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar, get_type_hints

import typer

from launcher.commands.arguments import End, LinkModel, Name, Nodes, Sensors, Set, Start, Target, Trackers

if TYPE_CHECKING:
    from launcher.records import Plan
    from trackfield.scenario import Scenario


Asked = TypeVar("Asked", bound="Changed")


@dataclass(frozen=True)
class Changed:
    """A scenario, and what is changed in it; each field is an option of the command line."""

    scenario: Name
    overrides: Set = None
    target: Target = None
    start: Start = None
    end: End = None
    sensors: Sensors = None
    nodes: Nodes = None
    link: LinkModel = None
    tracker: Trackers = None

    @property
    def options(self) -> dict[str, Any]:
        """The changes, as ``launcher.plan.prepare.changes`` takes them."""
        return {
            "settings": self.overrides or (),
            "target": self.target,
            "start": self.start,
            "end": self.end,
            "sensors": self.sensors,
            "nodes": self.nodes,
            "link": self.link,
            "trackers": self.tracker or (),
        }


@dataclass(frozen=True)
class Request(Changed):
    """A changed scenario, and how it is to be run: the options of ``run`` and ``validate``."""

    seed: Annotated[int | None, typer.Option(help="The seed of every random draw; unset: the scenario's own.")] = None
    speed: Annotated[
        float | None, typer.Option(help="Emulated seconds per second of real time, for a run over processes.")
    ] = None
    virtual: Annotated[bool, typer.Option("--virtual", help="Run in virtual time, in a single process.")] = False
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
    bridge: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ID=DEVICE",
            help="Put a real device, like base=/dev/ttyUSB0, in the place of a process with a serial line, or, with "
            "ID=pty, a pseudo-terminal that the run makes; may be repeated.",
        ),
    ] = None
    serial: Annotated[
        list[str] | None,
        typer.Option(
            metavar="DEVICE",
            help="Put a real camera, like /dev/ttyUSB0, in the place of the field's own, or, with pty, "
            "a pseudo-terminal that the run makes: --bridge camera=DEVICE.",
        ),
    ] = None
    quiet: Annotated[bool, typer.Option("--quiet", help="Print errors only.")] = False

    def prepared(self) -> tuple[Scenario, Plan]:
        """The scenario and its plan. Raises ``ScenarioError`` with all that is wrong with this request."""
        from launcher.options import check_driver, check_endpoint
        from launcher.plan.bridges import OPTION, SERIAL, bridged, check_camera, looked_for, with_camera
        from launcher.plan.prepare import prepare
        from launcher.record.folder import check_folder

        bridges, cameras = self.bridge or (), self.serial or ()
        scenario, plan = prepare(
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
                    bridged=SERIAL if cameras else OPTION if bridges else "",
                ),
                partial(with_camera, bridges, cameras),
                *([partial(check_endpoint, self.connect, "--connect")] if self.connect else []),
                *([partial(check_folder, self.out)] if self.out else []),
            ],
            seed=self.seed,
            **self.options,
        )
        check_camera(plan, cameras)
        return scenario, looked_for(bridged(plan, with_camera(bridges, cameras)))

    def check_machine(self, plan: Plan) -> None:
        """Raise ``RunFailed`` if this machine cannot do such a run, ``ScenarioError`` for classes that no other process
        can import.
        """
        from launcher.options import check_viewer

        if not self.virtual:
            from launcher.plan.extensions import check_importable

            check_importable(plan)
            from launcher.processes.limits import check_machine  # loads Zenoh

            check_machine(plan, router=not self.connect, external=self.external)
        if self.live:
            check_viewer()


def command(kind: type[Asked]) -> Callable[[Callable[[Asked], None]], Callable[..., None]]:
    """Make a function of a ``kind`` of request a command of the command line that takes all its options."""

    def of(body: Callable[[Asked], None]) -> Callable[..., None]:
        def call(**options: object) -> None:
            body(kind(**options))  # type: ignore[arg-type]

        call.__name__, call.__doc__ = body.__name__, body.__doc__
        hints = call.__annotations__ = get_type_hints(kind, include_extras=True)
        taken = inspect.signature(kind).parameters.values()
        call.__signature__ = inspect.Signature([one.replace(annotation=hints[one.name]) for one in taken])  # type: ignore[attr-defined]
        return call

    return of
