"""Users' own sensors, by kind: the interface of their classes, and how they are made from a scenario."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, Protocol

from trackfield.errors import ScenarioError
from trackfield.files import FAR_M
from trackfield.options import made
from trackfield.plugins import Maker, Plugins
from trackfield.words import quoted
from trackfield.world.acoustic import AcousticSensor

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

ACOUSTIC: Final = "acoustic"
"""Trackfield's own kind."""
NEAREST_M: Final = 0.001
"""The shortest range of a sensor (m)."""
FINEST: Final = 1e-12
COARSEST: Final = 1e12
"""The smallest and the largest noise and resolution of a reading."""
MAX_VALUES: Final = 26
"""The most numbers that fit into a report (docs/wire.md)."""


class Sensor(Protocol):
    """A kind of sensor, the same at every node: a frozen dataclass whose fields a scenario sets in ``[sensor]``.

    A reading is m numbers, z = h(x) + noise. Nodes only call ``simulate``, trackers call the others. ``residual`` may
    be left out: it maps differences of readings (..., m) into their valid range, as for angles. So may
    ``fix_sensors``, the number of sensors that a position fix needs: two if m is 1, else one.
    """

    @property
    def range_m(self) -> float:
        """Beyond this distance (m) from the target nothing is measured, and its node sleeps."""
        ...

    @property
    def sd(self) -> Sequence[float]:
        """The noise's standard deviations (m,)."""
        ...

    @property
    def resolution(self) -> Sequence[float]:
        """The resolution with which each number is reported (m,)."""
        ...

    def simulate(
        self, target: tuple[float, float, float, float], position: tuple[float, float], normals: tuple[float, ...]
    ) -> Sequence[float] | None:
        """The reading (m,) of a ``target`` (x, y, vx, vy) from ``position``; None if nothing is measured.

        ``normals`` (m,) are draws from N(0, 1), the only randomness it may have. Nodes need no numpy for it.
        """
        ...

    def h(self, states: Array, positions: Array) -> Array:
        """Noiseless readings (..., K, m) of ``states`` (..., 4) from ``positions`` (K, 2)."""
        ...

    def jacobian(self, states: Array, positions: Array) -> Array:
        """dh/dx (..., K, m, 4)."""
        ...


SENSORS: Final = Plugins(
    "sensor", "trackfield.sensors", {ACOUSTIC: AcousticSensor}, methods=("simulate", "h", "jacobian")
)


def register_sensor(kind: str, maker: Maker) -> None:
    """Let scenarios of this Python process name a kind of sensor of your own (``Sensor``), as ``sensor.kind``.

    Runs over processes need a class that can be imported. Raises ``ScenarioError`` for ``acoustic``, and for a class
    without ``simulate``, ``h`` and ``jacobian``.
    """
    SENSORS.register(kind, maker)


def fix_sensors(sensor: Sensor) -> int:
    """The number of sensors whose readings of one instant determine a position."""
    return int(getattr(sensor, "fix_sensors", 2 if len(sensor.sd) == 1 else 1))


def make_sensor(kind: str, options: Mapping[str, Any]) -> Sensor:
    """The sensor of this kind with these options.

    Raises ``ScenarioError`` with the nearest name for an unknown kind, for unknown or unsuitable options, and for a
    sensor without range, noise or resolution.
    """
    if kind not in SENSORS:
        raise SENSORS.unknown(kind, "sensor.kind")
    sensor: Sensor = made(SENSORS[kind], options, "sensor")
    range_m = getattr(sensor, "range_m", None)
    if not (isinstance(range_m, int | float) and NEAREST_M <= range_m <= FAR_M):
        expected = f"metres, above 0: from {NEAREST_M:g} to {FAR_M:g}"
        raise ScenarioError(f"'{kind}' has {quoted(range_m)}", key="sensor.range_m", expected=expected)
    for name in ("sd", "resolution"):
        values = getattr(sensor, name, None)
        if not (isinstance(values, tuple) and values and all(FINEST <= v <= COARSEST for v in values)):
            raise ScenarioError(
                f"'{kind}' has {quoted(values)}",
                key=f"sensor.{name}",
                expected=f"a tuple of numbers above 0: from {FINEST:g} to {COARSEST:g}",
            )
    needs = getattr(sensor, "fix_sensors", 1)
    if not (isinstance(needs, int) and needs >= 1):
        what = f"'{kind}' has {needs!r}"
        raise ScenarioError(what, key="sensor.fix_sensors", expected="a whole number of at least 1")
    if not len(sensor.sd) == len(sensor.resolution) <= MAX_VALUES:
        what = f"'{kind}' has {len(sensor.sd)} sd and {len(sensor.resolution)} resolutions"
        raise ScenarioError(what, key="sensor.sd", expected=f"one of each per number, at most {MAX_VALUES}")
    return sensor
