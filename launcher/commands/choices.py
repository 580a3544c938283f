"""The choices for arguments and options, looked up only for completion in a shell and for ``--help``."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, Final

from typer.core import TyperCommand, TyperGroup


def scenarios() -> Iterator[str]:
    """The packaged scenarios."""
    from trackfield.scenario.packaged import names

    yield from names()


def links() -> Iterator[str]:
    """The link models."""
    from trackfield.scenario.keys import sections_of_file

    yield from sections_of_file()["link"].kinds


def trackers() -> Iterator[str]:
    """The trackers, including users' own."""
    from trackfield.filters.trackers import TRACKERS

    yield from TRACKERS


def detectors() -> Iterator[str]:
    """How the time of a pass is found in a recording."""
    from trackfield.acoustics.listener import DETECTORS

    yield from DETECTORS


def papers() -> Iterator[str]:
    """The papers that can be reproduced."""
    from launcher.reproduce.papers import names

    yield from names()


def kinds() -> Iterator[str]:
    """What ``list`` describes."""
    from launcher.commands.kinds import KINDS

    yield from KINDS


def settings() -> Iterator[str]:
    """The keys of a scenario, as ``--set`` takes them."""
    from trackfield.scenario.keys import sections_of_file, top_level

    for name in top_level():
        yield f"{name}="
    for name, section in sections_of_file().items():
        for key in [f"{name}."] if section.many else [f"{name}.{key}" for key in section.keys(None)]:
            yield f"{key}="


def runs() -> Iterator[str]:
    """The finished runs below runs/, the newest first."""
    from launcher.record.latest import LATEST, finished

    folders = finished()
    yield from [LATEST, f"{LATEST}~1"][: len(folders)]
    yield from map(str, folders)


def going_on() -> Iterator[str]:
    """The runs below runs/ that go on, the newest first."""
    from launcher.record.latest import LATEST, going_on

    folders = going_on()
    yield from [LATEST] * bool(folders)
    yield from map(str, folders)


def orders() -> Iterator[str]:
    """What system control may be told."""
    from trackfield.wire.outside import VERBS

    yield from VERBS


def completed(choices: Callable[[], Iterator[str]]) -> Callable[[str], list[str]]:
    """The completion of an incomplete word; without any, a shell offers files."""

    def complete(incomplete: str) -> list[str]:
        return [choice for choice in choices() if choice.startswith(incomplete)]

    return complete


class _Named(dict[str, str]):
    """The choices as text, by their names in a help text."""

    _KNOWN: Final[Mapping[str, Callable[[], Iterator[str]]]] = {
        "scenarios": scenarios,
        "links": links,
        "trackers": trackers,
        "detectors": detectors,
        "papers": papers,
        "kinds": kinds,
        "orders": orders,
    }

    def __missing__(self, name: str) -> str:
        return ", ".join(self._KNOWN[name]())


def _tidied(parameters: Iterable[Any]) -> None:
    """Put choices into their places, and no type beside a flag, which takes no value."""
    for parameter in parameters:
        if text := getattr(parameter, "help", None):
            parameter.help = text.format_map(_Named())
        if getattr(parameter, "is_flag", False):
            parameter.metavar = ""


class Choosing(TyperCommand):
    """A command whose help texts may name choices, like ``{trackers}``, which are looked up for ``--help`` alone."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """With the choices in place."""
        _tidied(self.get_params(ctx))
        super().format_help(ctx, formatter)


class Commands(TyperGroup):
    """The program itself."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """As ``Choosing`` does."""
        _tidied(self.get_params(ctx))
        super().format_help(ctx, formatter)
