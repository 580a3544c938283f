"""The terminal output of a run: a live table in a terminal, plain lines elsewhere, and the result. All on stderr."""

from __future__ import annotations

import os
import shlex
import shutil
import sys
import time
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Final

from rich.console import Console
from rich.live import Live
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from launcher.plan.bridges import NEW, link_of
from launcher.plan.forecast.foresight import Foresight
from launcher.plan.forecast.reception import Shares
from launcher.plan.forecast.warnings import summary
from launcher.plan.prepare import remarks
from launcher.record.figures.verdict import LOST, TRACKED, WITH_GAPS, told
from launcher.record.words import alarms, filmed, joules, led, passed, span
from launcher.records import ARRIVED, SENSES, Plan

if TYPE_CHECKING:
    from pathlib import Path

    from launcher.run import Observer, Outcome  # loads Rerun

PLAIN_EVERY_S: Final = 10.0
MAX_COMPLAINTS: Final = 3
MAX_MISSING: Final = 5
VERDICTS: Final = {TRACKED: "green", WITH_GAPS: "yellow", LOST: "red"}
console: Final = Console(stderr=True, highlight=False, soft_wrap=True)


class Quiet:
    """Shows nothing."""

    def starting(self, missing: Collection[str], of: int) -> None:
        """Nothing."""

    def running(self, status: dict[str, Any]) -> None:
        """Nothing."""


class Lines:
    """A line when all are ready, and one every few seconds."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self._next = 0.0
        self._next_missing: float | None = None

    def starting(self, missing: Collection[str], of: int) -> None:
        """Say that processes are starting, and now and then which are missing."""
        now = time.monotonic()
        if self._next_missing is None:
            console.print(f"starting {of} processes ...")
        elif now >= self._next_missing:
            console.print(_missing(missing, of))
        else:
            return
        self._next_missing = now + PLAIN_EVERY_S

    def running(self, status: dict[str, Any]) -> None:
        """Report progress now and then."""
        if status and status["t_s"] > 0 and time.monotonic() >= self._next:
            self._next = time.monotonic() + PLAIN_EVERY_S
            errors = ", ".join(f"{name} {_metres(e)}" for name, e in status["errors"].items())
            t, end = status["t_s"], self.plan.info.end_s
            console.print(f"t = {t:.0f} s of {end:.0f}: {'; '.join(_fates(status))}; error: {errors or '-'}")


class Screen:
    """A table that is redrawn in place."""

    def __init__(self, plan: Plan, live: Live) -> None:
        self.plan, self.live = plan, live

    def starting(self, missing: Collection[str], of: int) -> None:
        """How many are ready, and which are missing."""
        self.live.update(f"starting processes: {_missing(missing, of)}")

    def running(self, status: dict[str, Any]) -> None:
        """The table."""
        if not status:
            return
        table = Table(title=f"{self.plan.info.scenario}  t = {status['t_s']:.0f} / {self.plan.info.end_s:.0f} s")
        for column in ("nodes", "frames", "error"):
            table.add_column(column)
        columns = (
            [f"{name} {n}" for name, n in sorted(status["states"].items())],
            _fates(status),
            [f"{name} {_metres(error)}" for name, error in status["errors"].items()],
        )
        table.add_row(*("\n".join(lines) for lines in columns))
        self.live.update(table)


@contextmanager
def observing(plan: Plan, *, quiet: bool) -> Iterator[Observer]:
    """The observer that fits where stderr goes."""
    if quiet:
        yield Quiet()
    elif console.is_terminal:
        with Live(console=console, transient=True, refresh_per_second=4) as live:
            yield Screen(plan, live)
    else:
        yield Lines(plan)


@contextmanager
def progress(plan: Plan, *, quiet: bool) -> Iterator[Callable[[float | None], None]]:
    """A function to which a run in virtual time reports its time (s since the first step; None: it is over).

    A bar in a terminal, lines elsewhere.
    """
    end_s = plan.info.end_s
    if quiet:
        yield lambda _: None
    elif console.is_terminal:
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.fields[time]}"),
            TimeRemainingColumn(),
        )
        with Progress(*columns, console=console, transient=True) as bar:
            task = bar.add_task(plan.info.scenario, total=end_s, time="")

            def tick(t_s: float | None) -> None:
                time_s = f"t = {t_s:.0f} of {end_s:.0f} s" if t_s is not None else "writing tables and report"
                bar.update(task, completed=end_s if t_s is None else max(t_s, 0.0), time=time_s, refresh=True)

            yield tick
    else:
        yield _Steady(end_s).tick


class _Steady:
    """A line every few seconds of a run in virtual time."""

    def __init__(self, end_s: float) -> None:
        self.end_s = end_s
        self.begun = time.monotonic()
        self._next = self.begun + PLAIN_EVERY_S

    def tick(self, t_s: float | None) -> None:
        """Report progress, if a line is due."""
        now = time.monotonic()
        if now < self._next or t_s is None or t_s <= 0:
            return
        self._next = now + PLAIN_EVERY_S
        left_s = (now - self.begun) * (self.end_s - t_s) / t_s
        console.print(f"t = {t_s:.0f} s of {self.end_s:.0f}; about {span(left_s)} left")


def announce(plan: Plan) -> None:
    """Say what is about to run."""
    nodes = len(plan.info.tagged(SENSES))
    link = plan.run.link["model"]
    console.print(
        f"{plan.info.scenario}: {nodes} sensor node{'s' * (nodes != 1)}, {plan.info.end_s:.0f} s, link {link}, "
        f"seed {plan.run.seed}, trackers {', '.join(plan.info.trackers)}"
    )
    for remark in remarks(plan):
        note(remark)


def devices(plan: Plan, folder: Path) -> None:
    """Say where the real devices of a run are."""
    for id, device in plan.bridges.items():
        tell(f"in the place of {id}: {link_of(folder, id) if device == NEW else device}")
    if any(port.terminal and port.device for process in plan.processes for port in process.ports.values()):
        tell(f"orders: trackfield control {folder} status")


def warn(warnings: Iterable[str]) -> None:
    """Print the warnings."""
    for warning in warnings:
        console.print("[yellow]warning:[/]", Text(warning))


def note(remark: str) -> None:
    """Print a remark that matters for reading the figures."""
    console.print(f"[yellow]note:[/] {remark}")


def tell(what: str) -> None:
    """Print a line."""
    console.print(Text(what))


def assess(plan: Plan, seen: Foresight) -> None:
    """Print what can be expected of a plan, its warnings, and that it is valid."""
    for line in summary(plan, seen):
        tell(line)
    for kind, shares in seen.receptions.items():
        if shares:
            worst, mean = min(shares, key=lambda link: shares[link]), sum(shares.values()) / len(shares)
            ends = f"worst {shares[worst]:.1%} ({_end(shares, worst)})"
            tell(f"reception of {kind} {_way(plan, shares)}: mean {mean:.1%}, {ends}")
    warn(plan.warnings)
    many = len(plan.warnings)
    console.print(f"valid, with {many} warning{'s' * (many != 1)}" if many else "[green]valid[/]")


def _way(plan: Plan, shares: Shares) -> str:
    """Where these links begin and end; a place that all of them share is named."""
    sources, hearers = ({link[end] for link in shares} for end in (0, 1))
    sensors = {place.id for place in plan.info.tagged(SENSES)}

    def those(ids: set[str]) -> str:
        if len(ids) == 1:
            return next(iter(ids))
        return f"{len(ids)} sensor nodes that will report" if ids <= sensors else f"{len(ids)} places"

    return f"at {those(hearers)} from {those(sources)}"


def _end(shares: Shares, link: tuple[str, str]) -> str:
    """The end of a link that distinguishes it from the others."""
    same = [end for end in (0, 1) if len({other[end] for other in shares}) == 1]
    return link[1 - same[0]] if len(same) == 1 else " to ".join(link)


def conclude(outcome: Outcome) -> None:
    """Print the result, what went wrong, and the next command."""
    metrics = outcome.metrics
    if metrics["frames"]["sent"] is not None:  # it was recorded
        console.print(_result(metrics))
        for line in _surroundings(metrics):
            console.print(line)
        for line in alarms(metrics):
            console.print(f"[bold red]{line}[/]")
    for complaint in outcome.complaints[:MAX_COMPLAINTS]:
        console.print("[bold red]failed:[/]", Text(complaint), soft_wrap=True)
    if len(outcome.complaints) > MAX_COMPLAINTS:
        console.print(f"[bold red]... and {len(outcome.complaints) - MAX_COMPLAINTS} more[/] (metrics.json has all)")
    if outcome.unreported:
        console.print("[yellow]no report:[/]", Text(outcome.unreported), soft_wrap=True)
    if outcome.signal is not None:
        early = "ended early; everything up to then is in the run folder"
        console.print(f"[yellow]{'interrupted after its end; the run is complete' if outcome.complete else early}[/]")
    folder, page = str(outcome.folder), outcome.folder / "report.html"
    console.print(Text(f"run folder: {folder}"), soft_wrap=True)
    if not outcome.unreported:
        console.print(Text(f"report: {page}"), soft_wrap=True)
    console.print(Text(f"next: {program()} view {shlex.quote(folder)}"), soft_wrap=True)


def _missing(missing: Collection[str], of: int) -> str:
    first = ", ".join(sorted(missing)[:MAX_MISSING])
    more = ", ..." if len(missing) > MAX_MISSING else ""
    return f"{of - len(missing)} of {of} ready, missing {first}{more}"


def _fates(status: dict[str, Any]) -> list[str]:
    """What became of the frames so far, as far as that is settled."""
    outcomes = status["outcomes"]
    arrived = sum(n for outcome, n in outcomes.items() if outcome in ARRIVED)
    lost = [f"lost ({outcome}) {n}" for outcome, n in sorted(outcomes.items()) if outcome not in ARRIVED]
    return [f"frames sent {status['sent']}", f"delivered {arrived}", *lost]


def _result(metrics: dict[str, Any]) -> Table:
    table = Table()
    for column in ("tracker", "RMSE", "median error", "velocity RMSE", "steps", "verdict"):
        table.add_column(column, justify="left" if column in ("tracker", "verdict") else "right")
    for name, figures in metrics["trackers"].items():
        for view, m in figures["views"].items() if len(figures["views"]) > 1 else [("", figures)]:
            velocity = m["rmse"]["velocity"]
            table.add_row(
                f"{name}, {view}" if view else name,
                _metres(m["rmse"]["position"]),
                _metres(m["median_error"]),
                "-" if velocity is None else f"{velocity:.2f} m/s",
                f"{m['steps_tracked']} of {m['steps_expected']}",
                Text(told(m), style=VERDICTS.get(m["verdict"], "")),
            )
    frames = metrics["frames"]
    lost = ", ".join(f"{cause} {n}" for cause, n in frames["lost"].items() if n) or "none"
    table.caption = (
        f"frames: sent {frames['sent']}, delivered {frames['delivered']} (late {frames['late']}); lost: {lost}"
    )
    return table


def _surroundings(metrics: dict[str, Any]) -> Iterator[str]:
    """Clock errors and the energy from batteries, if there are any."""
    clock, energy, lifetime = metrics["clock_error_ms"], metrics["energy_j"], metrics["lifetime_s"]
    if clock["rms"] is not None:
        figures = f"{clock['rms']:.2f} ms rms, {clock['max']:.2f} ms at most"
        yield f"clock error of the processes that set their clocks, when they sent: {figures}"
    if refused := metrics["frames"]["refused"]:
        yield f"refused, as no frames of this field: {', '.join(f'{n} ({why})' for why, n in refused.items())}"
    yield from led(metrics)
    yield from passed(metrics)
    yield from filmed(metrics)
    if energy["total"] is not None:
        by = ", ".join(f"{cause} {joules(used)}" for cause, used in energy["by"].items() if used)
        spent = joules(energy["total"]) + (f" ({by})" if by else "")
        yield f"energy from batteries: {spent}, at most {joules(energy['max_node'])} from one"
    if lifetime["first_death"] is not None:
        names = {"first_death": "first empty", "half_dead": "half of them empty", "coverage_lost": "coverage lost"}
        times = [f"{text} after {span(lifetime[name])}" for name, text in names.items() if lifetime[name] is not None]
        yield f"batteries: {', '.join(times)}{' (at this rate)' if lifetime['extrapolated'] else ''}"


def _metres(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f} m"


def program() -> str:
    """The shortest command that calls this program."""
    if shutil.which("trackfield"):
        return "trackfield"
    return os.path.relpath(sys.argv[0])
