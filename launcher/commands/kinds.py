"""What ``list`` describes: everything that a scenario may name, from the tables in which the program itself looks.

What a thing is comes from its own docstring, or the description of the key that names it.
"""

from __future__ import annotations

import inspect
import json
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from trackfield.errors import ScenarioError
from trackfield.plugins import Plugins
from trackfield.scenario import names, summary
from trackfield.scenario.keys import Key, sections_of_file
from trackfield.scenario.section import OTHER
from trackfield.scenario.sensors import OF_GROUPS


@dataclass(frozen=True)
class Item:
    """One thing that can be chosen: its name, what it is, and its parameters as text."""

    name: str
    what: str
    parameters: str = ""


def scenarios() -> Iterator[Item]:
    """The packaged scenarios."""
    for name in names():
        yield Item(name, summary(name))


def trackers() -> Iterator[Item]:
    """Our own trackers, then those registered and installed."""
    from trackfield.filters.trackers import TRACKERS

    yield from _plugins(TRACKERS, {})


def sensors() -> Iterator[Item]:
    """Our own kind of sensor, then those registered and installed."""
    from trackfield.sensing.kinds import SENSORS

    yield from _plugins(SENSORS, {item.name: item for item in _section("sensor", OF_GROUPS)})


def architectures() -> Iterator[Item]:
    """Our own architectures, then those registered and installed."""
    from launcher.plan.architectures import ARCHITECTURES

    yield from _plugins(ARCHITECTURES, {item.name: item for item in _section("architecture")})


def radios() -> Iterator[Item]:
    """The radios of the link model ``lognormal_prr``."""
    from trackfield.link.radios import RADIOS

    for name, radio_of in RADIOS.items():
        radio = radio_of(9)  # LoRa's default
        figures = f"{radio.tx_dbm:g} dBm, noise {radio.noise_dbm:g} dBm, {radio.payload_bytes} bytes in a frame"
        yield Item(name, radio.what, f"{figures}, ack {radio.ack}, path loss {radio.channel}")


KINDS: Final[Mapping[str, Callable[[], Iterator[Item]]]] = {
    "scenarios": scenarios,
    "trackers": trackers,
    "links": lambda: _section("link"),
    "radios": radios,
    "sensors": sensors,
    "layouts": lambda: _section("field"),
    "paths": lambda: _section("target"),
    "architectures": architectures,
    "faults": lambda: _section("faults"),
}


def _section(name: str, without: Collection[str] = ()) -> Iterator[Item]:
    """The kinds of a section of the scenario file, ``without`` some keys; those that share all keys are one item."""
    section = sections_of_file()[name]
    tag = section.tag or "kind"
    shared: dict[tuple[Key, ...], list[str]] = {}
    for kind, keys in section.kinds.items():
        if kind != OTHER:
            shared.setdefault(tuple(keys.values()), []).append(kind or json.loads(keys[tag].default))
    for several, kinds in shared.items():
        what = next(key.meaning for key in several if key.name == tag)
        yield Item(
            ", ".join(kinds), what, ", ".join(_parameter(key) for key in several if key.name not in (tag, *without))
        )


def _parameter(key: Key) -> str:
    """A key with its default, if it has one."""
    return f"{key.name}={key.default}" if key.default else key.name


def _plugins(plugins: Plugins, known: Mapping[str, Item]) -> Iterator[Item]:
    """All classes of a kind; users' own say where they come from, or why they cannot be loaded."""
    for name in plugins:
        if name in known:
            yield known[name]
            continue
        try:
            maker = plugins[name]
        except ScenarioError as error:
            yield Item(name, error.what)
            continue
        origin = "" if name in plugins.own else f" ({plugins.place(name)})"
        yield Item(name, f"{_summary(inspect.getdoc(maker) or '')}{origin}".strip(), _options(maker))


def _summary(text: str) -> str:
    """The first paragraph of a docstring on one line, without its marks for code and its full stop."""
    return " ".join(text.partition("\n\n")[0].split()).replace("``", "").rstrip(".")


def _options(maker: Callable[..., object]) -> str:
    """The parameters of a class, with their defaults."""
    empty = inspect.Parameter.empty
    options = inspect.signature(maker).parameters.values()
    return ", ".join(one.name if one.default is empty else f"{one.name}={_toml(one.default)}" for one in options)


def _toml(value: object) -> str:
    try:
        return json.dumps(value)
    except TypeError:
        return repr(value)
