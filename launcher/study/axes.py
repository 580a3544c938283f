"""What a study varies: keys of the scenario with their values, and the scenario of each combination of them."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import date, time
from itertools import islice, product
from math import prod
from operator import index
from typing import Any, Final

import numpy as np

from launcher.options import check_elsewhere
from launcher.plan.prepare import checked, planned, warned
from launcher.study.settings.fairness import Facts, facts_of
from trackfield.errors import ScenarioError, told_of
from trackfield.scenario import Scenario
from trackfield.scenario.override import parse
from trackfield.scenario.quantities import MOST_SEED
from trackfield.scenario.sections.run import IDLE_S
from trackfield.scenario.toml import check_values, parsed
from trackfield.words import quoted, shortened

TRACKER: Final = "tracker"
"""Varied like a key: one tracker at a time, instead of those of the scenario."""
MOST_SEEDS: Final = 1_000_000
MOST_VARIANTS: Final = 10_000
"""Each is planned before the first of them runs."""
_TRACKERS: Final = "fusion.trackers"
ARCHITECTURE: Final = "architecture.kind"
"""A study that varies it compares fields of which most of the life has no target."""
_IDLE: Final = "run.idle_s"
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
    """One combination: the value of each axis, the scenario that has them, what is likely to go wrong with it, and
    what there is in its field."""

    values: Mapping[str, Any]
    scenario: Scenario
    warnings: tuple[str, ...] = ()
    facts: Facts | None = None

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
    if (variants := prod(len(axis.values) for axis in axes)) > MOST_VARIANTS:
        raise ScenarioError(f"{variants:,} combinations", key="vary", expected=f"{MOST_VARIANTS:,} or fewer")
    _apart(axes)
    scenario = _with_idle(scenario, axes)
    given = islice(_listed("seeds", seeds, "one or more, like range(100)"), MOST_SEEDS + 1)
    chosen = tuple(index(seed) if hasattr(seed, "__index__") else seed for seed in given)
    if len(chosen) > MOST_SEEDS:
        raise ScenarioError("there are too many", key="seeds", expected=f"{MOST_SEEDS:,} or fewer")
    if not chosen:
        raise ScenarioError("none given", key="seeds", expected="one or more, like range(100)")
    if len(set(chosen)) < len(chosen):
        raise ScenarioError("some are given twice", key="seeds", expected="each seed once")
    for seed in chosen:
        if not isinstance(seed, int) or not 0 <= seed <= MOST_SEED:
            checked(scenario, seed)  # raises the error
    return Design(scenario, axes, tuple(_variants(scenario, axes, chosen[0])), chosen)


def _with_idle(scenario: Scenario, axes: Sequence[Axis]) -> Scenario:
    """The scenario, with time without a target if architectures are compared: most of a field's life has none."""
    if scenario.run.idle_s is not None or any(overlap(axis.sets, _IDLE) for axis in axes):
        return scenario
    return scenario.set(_IDLE, IDLE_S) if any(overlap(axis.sets, ARCHITECTURE) for axis in axes) else scenario


def _axis(key: str, values: Iterable[Any]) -> Axis:
    listed = tuple(islice(_listed(key, values, "two values or more, like [50, 75]"), MOST_VARIANTS + 1))
    check_values({key: listed})
    given = tuple(map(_plain, listed))
    if key == "seed":
        raise ScenarioError("is not varied: a study has seeds of its own", key=key, expected="seeds")
    if len(given) < 2:
        what = f"has {f'one value, {shortened(label(given[0]))}' if given else 'no value'}"
        raise ScenarioError(what, key=key, expected="two values or more; --set sets a single one")
    for name, times in Counter(map(label, given)).items():
        if times > 1:
            raise ScenarioError(f"{shortened(name)} is given twice", key=key, expected="each value once")
    for value in given:
        if key == TRACKER and not isinstance(value, str):
            what = f"is {label(value)}"
            raise ScenarioError(what, key=key, expected="names of single trackers; fusion.trackers takes lists of them")
    return Axis(key, given)


def _listed(key: str, values: Iterable[Any], expected: str) -> Iterator[Any]:
    """What is in a list, which may be given as something else."""
    try:
        if not isinstance(values, str):
            return iter(values)
    except TypeError:
        pass
    raise ScenarioError(f"is {quoted(values)}, which is no list", key=key, expected=expected)


def _plain(value: Any) -> Any:
    """The same as TOML and JSON both have it: numpy's numbers as Python's, dates and times as text."""
    if isinstance(value, np.generic | np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, date | time):
        return value.isoformat()
    if isinstance(value, Mapping):
        return {key: _plain(one) for key, one in value.items()}
    return [_plain(one) for one in value] if isinstance(value, list | tuple) else value


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
            check_elsewhere(plan, (), virtual=True)
        except ScenarioError as error:
            if not named or error.key in settings:
                raise
            raise told_of(f"with {in_words(named)}", error) from None
        yield Variant(named, varied, plan.warnings, facts_of(varied, plan))


# --- as text ----------------------------------------------------------------------------------------------------------


def parse_vary(texts: Sequence[str]) -> dict[str, tuple[Any, ...]]:
    """``key=a,b,c`` of each as values by key; values that are not TOML are text between commas.

    Raises ``ScenarioError`` for a text of any other form, and for a key that is given twice.
    """
    found: dict[str, tuple[Any, ...]] = {}
    for text in texts:
        key, equals, values = (part.strip() for part in text.partition("="))
        if not key or not equals or not values:
            raise ScenarioError(f"{quoted(text)} varies nothing", file=_VARY, expected=_EXAMPLE)
        if key in found:
            raise ScenarioError("is varied twice", file=_VARY, key=key, expected="all its values in one --vary")
        found[key] = _values(key, values)
    return found


def _values(key: str, text: str) -> tuple[Any, ...]:
    try:
        found = parsed(f"values = [{text}]")
        values = found["values"] if len(found) == 1 else [text]
    except ValueError:
        parts = _split(text)
        if len(parts) == 1 and text.startswith("[") and text.endswith("]"):
            parts = _split(text[1:-1])  # the whole array was given, with text that has no quotes
        if not all(parts):
            raise ScenarioError(f"an empty value in {quoted(text)}", file=_VARY, key=key, expected=_EXAMPLE) from None
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
