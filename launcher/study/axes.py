"""What a study varies: keys of the scenario with their values, and the scenario of each combination of them."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from operator import index
from typing import Any, Final

from launcher.plan.prepare import checked, planned, warned
from trackfield.errors import ScenarioError
from trackfield.scenario import Scenario
from trackfield.scenario.override import parse

TRACKER: Final = "tracker"
"""Varied like a key: one tracker at a time, instead of those of the scenario."""
_TRACKERS: Final = "fusion.trackers"
_VARY: Final = "--vary"
_EXAMPLE: Final = "KEY=VALUE,VALUE,... like field.spacing_m=50,75,100"


@dataclass(frozen=True)
class Axis:
    """A varied key, and its values in their order."""

    key: str
    values: tuple[Any, ...]

    @property
    def numeric(self) -> bool:
        """Whether all values are numbers; others are categories."""
        return all(isinstance(value, int | float) and not isinstance(value, bool) for value in self.values)

    @property
    def sets(self) -> str:
        """The key of the scenario that it sets."""
        return _TRACKERS if self.key == TRACKER else self.key

    def setting(self, value: Any) -> tuple[str, Any]:
        """The key of the scenario that it sets, and to what."""
        return self.sets, [value] if self.key == TRACKER else value


@dataclass(frozen=True)
class Variant:
    """One combination: the value of each axis, the scenario that has them, and what is likely to go wrong with it."""

    values: Mapping[str, Any]
    scenario: Scenario
    warnings: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Its values in words; empty if nothing is varied."""
        return in_words(self.values)


@dataclass(frozen=True)
class Design:
    """What a study is to run: every variant of a scenario with every seed."""

    scenario: Scenario
    axes: tuple[Axis, ...]
    variants: tuple[Variant, ...]
    seeds: tuple[int, ...]

    @property
    def jobs(self) -> list[tuple[int, int]]:
        """(place of the variant, seed) of each run, in the order of the results."""
        return [(place, seed) for place in range(len(self.variants)) for seed in self.seeds]


def design(scenario: Scenario, seeds: Iterable[int], vary: Mapping[str, Iterable[Any]] | None = None) -> Design:
    """All combinations of what is varied, each checked. Raises ``ScenarioError`` for any that cannot be run."""
    axes = tuple(_axis(key, values) for key, values in (vary or {}).items())
    _apart(axes)
    chosen = tuple(index(seed) if hasattr(seed, "__index__") else seed for seed in seeds)
    if not chosen:
        raise ScenarioError("none given", key="seeds", expected="one or more, like range(100)")
    if len(set(chosen)) < len(chosen):
        raise ScenarioError("some are given twice", key="seeds", expected="each seed once")
    for seed in chosen:
        if not isinstance(seed, int) or seed < 0:
            checked(scenario, seed)  # raises the error
    return Design(scenario, axes, tuple(_variants(scenario, axes, chosen[0])), chosen)


def _axis(key: str, values: Iterable[Any]) -> Axis:
    given = (values,) if isinstance(values, str) else tuple(values)
    if key == "seed":
        raise ScenarioError("is not varied: a study has seeds of its own", key=key, expected="seeds")
    if len(given) < 2:
        what = f"has {f'one value, {label(given[0])}' if given else 'no value'}"
        raise ScenarioError(what, key=key, expected="two values or more; --set sets a single one")
    for value in given:
        if sum(label(other) == label(value) for other in given) > 1:
            raise ScenarioError(f"{label(value)} is given twice", key=key, expected="each value once")
        if key == TRACKER and not isinstance(value, str):
            what = f"is {label(value)}"
            raise ScenarioError(what, key=key, expected="names of single trackers; fusion.trackers takes lists of them")
    return Axis(key, given)


def _apart(axes: Sequence[Axis]) -> None:
    for i, one in enumerate(axes):
        for other in axes[:i]:
            if overlap(one.sets, other.sets):
                what = f"is varied, and so is {other.key}"
                raise ScenarioError(what, key=one.key, expected="keys that do not overlap")


def overlap(one: str, other: str) -> bool:
    """Whether two keys overlap: they are equal, or one is the section of the other."""
    return one == other or one.startswith(f"{other}.") or other.startswith(f"{one}.")


def _variants(scenario: Scenario, axes: Sequence[Axis], seed: int) -> Iterator[Variant]:
    for values in product(*(axis.values for axis in axes)):
        named = {axis.key: value for axis, value in zip(axes, values, strict=True)}
        try:
            settings = dict(axis.setting(value) for axis, value in zip(axes, values, strict=True))
            varied = scenario.set_all(settings) if settings else scenario
            plan = warned(planned(checked(varied, seed)))
        except ScenarioError as error:
            if not named or error.key in settings:
                raise
            raise ScenarioError(f"with {in_words(named)}: {error}") from None
        yield Variant(named, varied, plan.warnings)


# --- as text ----------------------------------------------------------------------------------------------------------


def parse_vary(texts: Sequence[str]) -> dict[str, tuple[Any, ...]]:
    """``key=a,b,c`` of each as values by key; values that are not TOML are text between commas.

    Raises ``ScenarioError`` for a text of any other form, and for a key that is given twice.
    """
    found: dict[str, tuple[Any, ...]] = {}
    for text in texts:
        key, equals, values = (part.strip() for part in text.partition("="))
        if not key or not equals or not values:
            raise ScenarioError(f"{text!r} varies nothing", file=_VARY, expected=_EXAMPLE)
        if key in found:
            raise ScenarioError("is varied twice", file=_VARY, key=key, expected="all its values in one --vary")
        found[key] = _values(key, values)
    return found


def _values(key: str, text: str) -> tuple[Any, ...]:
    try:
        values = tomllib.loads(f"values = [{text}]")["values"]
    except tomllib.TOMLDecodeError:
        parts = _split(text)
        if len(parts) == 1 and text.startswith("[") and text.endswith("]"):
            parts = _split(text[1:-1])  # the whole array was given, with text that has no quotes
        if not all(parts):
            raise ScenarioError(f"an empty value in {text!r}", file=_VARY, key=key, expected=_EXAMPLE) from None
        return tuple(parse(f"{key}={part}")[1] for part in parts)
    alone = len(values) == 1 and isinstance(values[0], list)  # the whole array was given
    return tuple(values[0] if alone else values)


def _split(text: str) -> list[str]:
    """Split at the commas that are not in brackets."""
    parts, depth = [""], 0
    for character in text:
        depth += (character in "[{") - (character in "]}")
        if character == "," and depth <= 0:
            parts.append("")
        else:
            parts[-1] += character
    return [part.strip() for part in parts]


def label(value: Any) -> str:
    """A value as short text."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return f"{value:.12g}"
    return value if isinstance(value, str) else json.dumps(value)


def in_words(values: Mapping[str, Any]) -> str:
    """``key=value`` of each."""
    return ", ".join(f"{key}={label(value)}" for key, value in values.items())
