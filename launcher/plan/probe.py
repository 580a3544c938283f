"""A user's kind of sensing tried out before a run: whether its methods return what they should."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite, isnan
from numbers import Real
from typing import Any, Final

import numpy as np

from trackfield.errors import RunFailed, ScenarioError
from trackfield.filters.checked import started
from trackfield.role import NS
from trackfield.scenario.faults import Bias
from trackfield.sensing.complete import Kind
from trackfield.tracking.following import ANYWHERE
from trackfield.words import quoted
from trackfield.world.path import Path
from trackfield.world.placed import instants
from trackfield.world.scene import Scene, Still

_BIASES: Final = {"deg": "bias_deg", "dB": "bias_db", "dBm": "bias_db"}
"""The key of a bias that is in a unit."""


def probe(kind: Kind) -> None:
    """Raise ``ScenarioError`` unless the methods of a kind return what they should."""
    m, r, more = kind.m, kind.range_m, [one.mean for one in kind.unknowns]
    moving = np.array([[r / 2.0, r / 3.0, 1.0, -1.0], [-r / 3.0, r / 4.0, 0.0, 0.0]])
    states = np.hstack((moving, np.tile(more, (2, 1))))
    for count in (3, 0):
        positions = np.array([[0.0, 0.0], [r / 5.0, 0.0], [0.0, -r / 5.0]])[:count]
        for x in (states, states[0]):
            shape = (*x.shape[:-1], count, m)
            _check(kind, "h", shape, x, positions)
            _check(kind, "jacobian", (*shape, 4 + len(more)), x, positions)
            if kind.variance is not None:
                variance = _check(kind, "variance", shape, x, positions)
                if not (np.isfinite(variance).all() and (variance > 0.0).all()):
                    expected = "finite numbers above 0, at any distance"
                    raise ScenarioError(
                        f"returned {variance}", key=f"sensor '{kind.name}': variance", expected=expected
                    )
            _check(kind, "residual", shape, np.zeros(shape))
        z = np.zeros((count, kind.n))
        _check(kind, "loudness", (count,), z)
        if kind.log_clutter is not None:
            _check(kind, "log_clutter", (count,), z, positions)
    _probe_simulate(kind)
    _probe_of_nothing(kind)


def _probe_simulate(kind: Kind) -> None:
    """``simulate``, and what is made of the numbers that it returns."""
    read = [_simulated(kind, place) for place in _places(kind)]
    for values in read:
        if values is not None:
            _probe_reading(kind, values)
    z = np.array([values for values in read if values is not None], float)
    if len(z):
        _check(kind, "z", z.shape, z)
    if kind.fix is not None and len(z) == len(read):
        fix = _call(kind, "fix", kind.fix, kind.z(z), np.array(_places(kind)), ANYWHERE)
        if fix is not None:
            _call(kind, "fix", started, kind.name, fix, len(kind.unknowns))


def _places(kind: Kind) -> list[tuple[float, float]]:
    """Three, not in a line, within the range of a target at half of it."""
    return [(0.0, 0.0), (kind.range_m / 5.0, 0.0), (0.0, -kind.range_m / 5.0)]


def _simulated(kind: Kind, place: tuple[float, float]) -> Any:
    target = Still((kind.range_m / 2.0, 0.0, 1.0, 0.0))
    values = _call(kind, "simulate", kind.simulate, target, 0, place, (0.0,) * kind.n)
    return None if values is None else _numbers(kind, "simulate", values)


def _numbers(kind: Kind, name: str, values: Any) -> Any:
    """What a method returned, which is n finite numbers."""
    if not _call(kind, name, lambda: len(values) == kind.n and all(map(isfinite, values))):
        raise _wrong(kind, name, values, f"{kind.n} numbers, or None")
    return values


def _probe_reading(kind: Kind, values: Any) -> None:
    """The way of numbers to a message and back."""
    for name, method in (("level", kind.level), ("drawn", kind.drawn)):
        number = _call(kind, name, method, values)
        if not isinstance(number, Real) or isnan(float(number)):
            raise _wrong(kind, name, number, "a number")
    for name, own in (("biased", kind.biased), ("corrected", kind.corrected)):
        values = _numbers(kind, name, _call(kind, name, own, values, "n000"))
    if not isinstance(possible := _call(kind, "possible", kind.possible, values), bool | np.bool):
        raise _wrong(kind, "possible", possible, "True or False")
    message = _call(kind, "reading", lambda: kind.reading(values).report(1))
    if not kind.takes(message):
        raise _wrong(kind, "reading", message, f"a reading that reports a {kind.message.__name__}")
    _numbers(kind, "values", _call(kind, "values", kind.values, message))
    if not isinstance(words := _call(kind, "words", kind.words, message), str):
        raise _wrong(kind, "words", words, "a text")
    if not kind.takes(longest := _call(kind, "longest", kind.longest)):
        raise _wrong(kind, "longest", longest, f"a {kind.message.__name__}")


def _probe_of_nothing(kind: Kind) -> None:
    """What a sensor reads of no target, and when it reports by itself."""
    for fault in ("stuck", "babble"):
        if kind.invented is not None:
            found = _call(kind, "invented", kind.invented, fault, kind.threshold, lambda purpose: 0.5)
            if found is not None:
                _numbers(kind, "invented", found)
    if kind.rhythm == "events":
        r, window = kind.range_m, (0, 10 * NS)
        past = Scene((Path.of([(0.0, -r, r / 9.0, r / 5.0, 0.0), (10.0, r, r / 9.0, r / 5.0, 0.0)]),))
        _call(kind, "event", lambda: instants(kind.event(past, window, (0.0, 0.0)), window))


def _wrong(kind: Kind, name: str, returned: object, expected: str) -> ScenarioError:
    return ScenarioError(f"returned {quoted(returned)}", key=f"sensor '{kind.name}': {name}", expected=expected)


def _check(kind: Kind, name: str, expected: tuple[int, ...], *arguments: Any) -> Any:
    """What a method returns for these arrays, which has this shape."""
    given = np.asarray(_call(kind, name, getattr(kind, name), *arguments))
    if given.shape != expected:
        took = " and ".join(f"{one.shape}" for one in arguments)
        what = f"returned an array {given.shape} for arrays {took}"
        raise ScenarioError(what, key=f"sensor '{kind.name}': {name}", expected=f"{expected}")
    return given


def _call(kind: Kind, name: str, method: Callable[..., Any], *arguments: object) -> Any:
    try:
        return method(*arguments)
    except RunFailed as error:
        raise ScenarioError(str(error), key=f"sensor '{kind.name}': {name}") from None
    except Exception as error:
        raise ScenarioError(f"{type(error).__name__}: {error}", key=f"sensor '{kind.name}': {name}") from error


def biases(number: int, fault: Bias, kind: Kind) -> tuple[float, ...]:
    """What a bias adds to each number of a reading. Raises ``ScenarioError`` if that has no meaning for the kind."""
    key = f"faults[{number}]"
    if fault.by is not None:
        if len(fault.by) != kind.n:
            what = f"has {len(fault.by)} numbers, and a reading of kind '{kind.name}' has {kind.n}"
            raise ScenarioError(what, key=f"{key}.by", expected=f"a list of {kind.n}")
        return fault.by
    for name, value in (("bias_deg", fault.bias_deg), ("bias_db", fault.bias_db)):
        if value and not any(_BIASES.get(unit) == name for unit in kind.units):
            what = f"has no meaning for sensors of kind '{kind.name}'"
            raise ScenarioError(what, key=f"{key}.{name}", expected=f"by, a list of {kind.n} numbers in their units")
    return tuple(getattr(fault, _BIASES[unit]) if unit in _BIASES else 0.0 for unit in kind.units)
