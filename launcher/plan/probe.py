"""A user's kind of sensing tried out before a run: whether its methods return what they should."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from typing import Any

import numpy as np

from trackfield.errors import ScenarioError
from trackfield.scenario.faults import Bias
from trackfield.sensing.complete import Kind
from trackfield.world.scene import Still


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
        z = np.zeros((count, kind.n))
        _check(kind, "loudness", (count,), z)
        if kind.log_clutter is not None:
            _check(kind, "log_clutter", (count,), z, positions)
    _probe_simulate(kind)


def _probe_simulate(kind: Kind) -> None:
    target = Still((kind.range_m / 2.0, 0.0, 1.0, 0.0))
    values = _call(kind, "simulate", kind.simulate, target, 0, (0.0, 0.0), (0.0,) * kind.n)
    if values is not None and not (len(values) == kind.n and all(map(isfinite, values))):
        key, expected = f"sensor '{kind.name}': simulate", f"{kind.n} numbers, or None"
        raise ScenarioError(f"returned {values!r}", key=key, expected=expected)


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
    named = {"deg": ("bias_deg", fault.bias_deg), "dB": ("bias_db", fault.bias_db)}
    for unit, (name, value) in named.items():
        if value and unit not in kind.units:
            what = f"has no meaning for sensors of kind '{kind.name}'"
            raise ScenarioError(what, key=f"{key}.{name}", expected=f"by, a list of {kind.n} numbers in their units")
    return tuple(named[unit][1] if unit in named else 0.0 for unit in kind.units)
