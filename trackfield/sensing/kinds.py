"""Kinds of sensing by name: Trackfield's own, and those that users register or install."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from math import isfinite
from numbers import Real
from typing import Any, Final

from trackfield.errors import ScenarioError
from trackfield.files import FAR_M, LONG_S
from trackfield.models.noise import Colour
from trackfield.models.unknowns import Unknown
from trackfield.plugins import Maker, Plugins
from trackfield.sensing.complete import FIELD, METHODS, METHODS_OR_NONE, NEAREST, OPEN, PASS_NOISE, Kind, arguments
from trackfield.sensing.cpa import Cpa
from trackfield.sensing.doa import Doa
from trackfield.sensing.energy import Energy
from trackfield.sensing.range import Range
from trackfield.sensing.rss import Rss
from trackfield.sensing.sensing import LAYERS
from trackfield.wire.registry import known_class
from trackfield.words import quoted

DEFAULT: Final = "doa"
"""The kind of a scenario that names none."""
FORMER: Final = {"acoustic": "doa"}
"""What kinds were called before."""
NEAREST_M: Final = 0.001
"""The shortest range of a sensor (m)."""
FINEST: Final = 1e-12
COARSEST: Final = 1e12
"""The smallest and the largest noise and resolution of a reading."""
_NS: Final = 1e9
MAX_VALUES: Final = 26
"""The most numbers that fit into a report (docs/wire.md)."""
MOST_UNKNOWNS: Final = 8

SENSORS: Final = Plugins(
    "sensor",
    "trackfield.sensors",
    {DEFAULT: Doa, "range": Range, "rss": Rss, "energy": Energy, "cpa": Cpa},
    methods=("simulate", "h", "jacobian"),
)


def register_sensor(kind: str, maker: Maker) -> None:
    """Let scenarios of this Python process name a kind of sensing of your own (``sensing.Sensing``).

    Runs over processes need a class that can be imported. Raises ``ScenarioError`` for the name of one of Trackfield's
    own, and for a class without ``simulate``, ``h`` and ``jacobian``.
    """
    SENSORS.register(kind, maker)


def known_sensor(kind: str, options: Mapping[str, Any], *, recorded: bool = False) -> Kind:
    """The kind with options that were checked before, by whoever planned the run: nodes do no more than this."""
    if kind not in SENSORS:
        raise SENSORS.unknown(kind, "sensor.kind")
    return Kind(kind, SENSORS[kind](**options), recorded=recorded)


class Table(dict[str, Any]):
    """An option that is a table by sensor; it is never changed, so that kinds can be told apart by it."""

    def __hash__(self) -> int:  # type: ignore[override]
        return hash(frozenset(self.items()))


def hashable(options: Mapping[str, Any]) -> tuple[tuple[str, Any], ...]:
    """The options in order, as what tells kinds apart."""
    items = ((name, Table(value) if isinstance(value, Mapping) else value) for name, value in options.items())
    return tuple(sorted(items, key=lambda item: item[0]))


def own_options(options: Mapping[str, Any], id: str) -> Mapping[str, Any]:
    """The options as far as they are about the sensor ``id``: of a table by sensor, its own entry."""
    if not any(isinstance(value, Mapping) for value in options.values()):
        return options
    return {
        name: {key: one for key, one in value.items() if key == id} if isinstance(value, Mapping) else value
        for name, value in options.items()
    }


def known_kind(kind: str, options: Mapping[str, Any], *, recorded: bool = False) -> Kind:
    """As ``known_sensor``, the same object for the same arguments."""
    return _known(SENSORS.get(kind), kind, hashable(options), recorded=recorded)


@lru_cache(maxsize=64)
def _known(maker: Maker | None, kind: str, options: tuple[tuple[str, Any], ...], *, recorded: bool) -> Kind:
    return known_sensor(kind, dict(options), recorded=recorded)


def make_sensor(kind: str, options: Mapping[str, Any], *, recorded: bool = False) -> Kind:
    """The kind with these options; ``recorded`` as in ``Kind``.

    Raises ``ScenarioError`` with the nearest name for an unknown kind, for unknown or unsuitable options, and for
    members that a kind cannot have.
    """
    from trackfield.options import made  # late: a node need not load it

    if kind not in SENSORS:
        if kind in FORMER:
            raise ScenarioError(f"'{kind}' is called otherwise now", key="sensor.kind", expected=f"'{FORMER[kind]}'")
        raise SENSORS.unknown(kind, "sensor.kind")
    own = made(SENSORS[kind], options, "sensor")
    _check_members(kind, own)
    _check_counts(kind, own)
    _check_passes(kind, own)
    made_kind = Kind(kind, own, recorded=recorded)
    if made_kind.adaptive and made_kind.rhythm == "events":
        what = f"'{kind}' has {made_kind.thresholds}, which differ, and its sensors report by themselves"
        raise ScenarioError(what, key="sensor.thresholds", expected="one level, twice, or the rhythm steps")
    return made_kind


def _check_members(kind: str, own: Any) -> None:
    """Raise ``ScenarioError`` for a member that no kind can have, by itself."""
    for name, fine, expected in _RULES:
        value = getattr(own, name, None)
        if not fine(value) and not (name in _OPTIONAL and not hasattr(own, name)):
            setting = name in _OPTIONAL and name in getattr(own, "__dataclass_fields__", ())
            rename = f"; a setting of another meaning needs another name than '{name}'" if setting else ""
            raise ScenarioError(f"'{kind}' has {quoted(value)}", key=f"sensor.{name}", expected=expected + rename)


def _check_counts(kind: str, own: Any) -> None:
    """Raise ``ScenarioError`` for members that do not go together."""
    if not len(own.sd) <= len(own.resolution) <= MAX_VALUES:
        what = f"'{kind}' has {len(own.sd)} sd and {len(own.resolution)} resolutions"
        raise ScenarioError(what, key="sensor.sd", expected=f"one of each per number, at most {MAX_VALUES}")
    if len(units := getattr(own, "units", own.resolution)) != len(own.resolution):
        raise ScenarioError(f"'{kind}' has {units!r}", key="sensor.units", expected="a text for each number")
    if (draws := getattr(own, "draws", None)) is not None and len(draws) != len(own.resolution):
        raise ScenarioError(f"'{kind}' has {draws!r}", key="sensor.draws", expected="a text for each number, or None")
    if draws is not None and getattr(own, "colour", None) is not None:
        raise ScenarioError(f"'{kind}' has {draws!r}, and a colour", key="sensor.draws", expected="one of the two")
    if getattr(own, "bearings", False) and len(own.resolution) < len(_BEARING):
        expected = f"at least {len(_BEARING)} numbers: {' and '.join(_BEARING)}"
        raise ScenarioError(f"'{kind}' has one number", key="sensor.bearings", expected=expected)
    if (count := arguments(own.simulate)) not in (FIELD, NEAREST):
        what = "takes any number of arguments" if count == OPEN else f"takes {count} arguments"
        expected = "(scene, t_ns, place, normals), or (target, place, normals), without defaults"
        raise ScenarioError(what, key=f"sensor '{kind}': simulate", expected=expected)
    if getattr(own, "thresholds", None) is not None and not (hasattr(own, "level") or hasattr(own, "reading")):
        raise ScenarioError(f"'{kind}' has none", key="sensor.level", expected="a method level: it has thresholds")


def _check_passes(kind: str, own: Any) -> None:
    """Raise ``ScenarioError`` for a kind that reports passes and does not say what their noise is."""
    if not getattr(own, "passes", False):
        return
    fields = getattr(own, "__dataclass_fields__", ())
    lacks = [name for name in PASS_NOISE if name not in fields]
    lacks += [name for name in (*PASS_NOISE, *_PASS_POWERS) if name not in lacks and not _sd(getattr(own, name, None))]
    lacks += [] if callable(getattr(own, "time_sd", None)) else ["time_sd"]
    if lacks:
        options = f"a dataclass with numbers {', '.join((*PASS_NOISE, *_PASS_POWERS))} and a method time_sd"
        raise ScenarioError(f"'{kind}' lacks {', '.join(lacks)}", key="sensor.passes", expected=options)
    if len(own.resolution) < len(_PASS):
        expected = f"at least {len(_PASS)} numbers: {', '.join(_PASS)}"
        raise ScenarioError(f"'{kind}' has {len(own.resolution)}", key="sensor.passes", expected=expected)


def _sd(value: object) -> bool:
    return _number(value) and 0.0 <= value <= COARSEST  # type: ignore[operator]


def _metres(value: object) -> bool:
    return isinstance(value, int | float) and NEAREST_M <= value <= FAR_M


def _positive(values: object) -> bool:
    return isinstance(values, tuple) and bool(values) and all(_number(v) and FINEST <= v <= COARSEST for v in values)


def _number(value: object) -> bool:
    return isinstance(value, Real)


def _count(value: object) -> bool:
    return isinstance(value, int) and value >= 1


def _unknowns(values: object) -> bool:
    return isinstance(values, tuple) and len(values) <= MOST_UNKNOWNS and all(map(_unknown, values))


def _unknown(one: object) -> bool:
    return (
        isinstance(one, Unknown)
        and isinstance(one.name, str)
        and all(map(_number, (one.sd, one.walk_sd, one.mean)))
        and FINEST <= one.sd <= COARSEST
        and 0.0 <= one.walk_sd <= COARSEST
        and isfinite(one.mean)
    )


def _texts(values: object) -> bool:
    return isinstance(values, tuple) and all(isinstance(one, str) for one in values)


def _ordered(value: object) -> bool:
    if not (isinstance(value, tuple) and len(value) == 2 and all(map(_number, value))):
        return value is None
    return bool(value[0] <= value[1])


def _names(values: object) -> bool:
    return values is None or _texts(values)


def _flag(value: object) -> bool:
    return isinstance(value, bool)


def _text(value: object) -> bool:
    return isinstance(value, str)


def _layer(value: object) -> bool:
    return value in ("", *LAYERS)


def _message(value: object) -> bool:
    return isinstance(value, type) and known_class(value)


def _method_or_none(value: object) -> bool:
    return value is None or callable(value)


def _share(value: object) -> bool:
    return _number(value) and 0.0 <= value <= 1.0  # type: ignore[operator]


def _speed(value: object) -> bool:
    return isinstance(value, int | float) and value > 0


def _memory(value: object) -> bool:
    return isinstance(value, int | float) and 0 <= value <= LONG_S


def _colour(value: object) -> bool:
    if not isinstance(value, Colour):
        return value is None
    slow, slow_s, fixed = value
    return (
        all(map(_number, value)) and min(slow, fixed) >= 0.0 and slow + fixed <= 1.0 and 1.0 / _NS <= slow_s <= LONG_S
    )


_SMALL: Final = f"a tuple of numbers above 0: from {FINEST:g} to {COARSEST:g}"
_FAR: Final = f"metres, above 0: from {NEAREST_M:g} to {FAR_M:g}"
_PASS: Final = ("a time (s)", "a strength (dB)", "a width (s)")
_PASS_POWERS: Final = ("distance_power", "speed_power")
_BEARING: Final = ("a bearing (rad)", "a level (dB)")
_RULES: Final = (
    ("range_m", _metres, _FAR),
    ("sd", _positive, _SMALL),
    ("resolution", _positive, _SMALL),
    ("fix_sensors", _count, "a whole number of at least 1"),
    ("report_m", _metres, _FAR),
    ("unknowns", _unknowns, f"a tuple of Unknown(name, sd, walk_sd, mean), at most {MOST_UNKNOWNS}, sd above 0"),
    ("units", _texts, "a tuple of texts"),
    ("rhythm", ("steps", "events").__contains__, "steps or events"),
    ("layer", _layer, f"one of {', '.join(LAYERS)}, or an empty text"),
    ("thresholds", _ordered, "None, or the lowest and the highest level"),
    ("speed_m_s", _speed, "metres per second, above 0"),
    ("memory_s", _memory, f"seconds, from 0 to {LONG_S:g}"),
    ("colour", _colour, "None, or a Colour(slow, slow_s, fixed): shares of at most 1 together, seconds above 0"),
    ("missing", _share, "a share from 0 to 1"),
    ("modules", _texts, "a tuple of texts"),
    ("summary", _text, "a text"),
    ("bearings", _flag, "True or False"),
    ("passes", _flag, "True or False"),
    ("draws", _names, "a tuple of texts, or None"),
    ("message", _message, "a class of messages of trackfield/wire"),
    *((name, callable, "a method") for name in METHODS),
    *((name, _method_or_none, "a method") for name in METHODS_OR_NONE),
)
_OPTIONAL: Final = frozenset(name for name, _, _ in _RULES) - {"range_m", "sd", "resolution"}
