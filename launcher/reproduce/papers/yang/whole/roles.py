"""Table 1 of Yang et al. with roles: what microphones hear goes through detectors, radio, head and solver to the base.

The runs are those of the field experiments: to and fro on a line at 87 degrees (A, C) and on one at 128 degrees (B, D),
at 30 mph. The paper's coordinates are northing and easting, its angles are headings.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any, Final, NamedTuple

from launcher.reproduce.kernels.study import Experiment, Found
from launcher.reproduce.papers.yang.whole.runs import run

MOST: Final = 25
"""Runs of each, of four passes; one takes 6 s of processor time."""
ROLES: Final = ", roles"
ARGMAX, FIT, UNTOLD = f"argmax{ROLES}", f"fit{ROLES}", f"fit without sds{ROLES}"
_CHANGES: Final[Mapping[str, Mapping[str, Any]]] = {
    ARGMAX: {"sensor.detector": "argmax"},
    FIT: {"sensor.detector": "fit", "sensor.variances": True},
    UNTOLD: {"sensor.detector": "fit"},
}
EXPERIMENTS: Final = {
    name: Experiment(partial(run, changes), batch=1, most=MOST, roles=True) for name, changes in _CHANGES.items()
}
WAYS: Final[Mapping[str, tuple[str, str]]] = {
    "argmax + ecpa": (ARGMAX, "ecpa"),
    "fit + ecpa": (FIT, "ecpa"),
    "fit + ml": (FIT, "ml"),
    "fit without sds + ml": (UNTOLD, "ml"),
}
"""Experiment and tracker by name: detector and solver. Without sds, the head goes by what the scenario says of it."""
DIRECTIONS: Final = ("AC", "CA", "BD", "DB")
"""Of the passes of a run, in their order."""


class Tested(NamedTuple):
    """A run of Table 1: its direction, and how far off it was computed: m, mph, degrees."""

    direction: str
    location: float
    speed: float
    heading: float


TABLE_1: Final = (
    Tested("AC", 1.0, 2.0, 3.0),
    Tested("AC", 1.0, 3.0, 3.0),
    Tested("CA", 2.236, 12.0, 3.0),
    Tested("CA", 6.0, 3.0, 24.0),
    Tested("BD", 1.0, 1.0, 1.0),
    Tested("BD", 1.0, 2.0, 2.0),
    Tested("DB", 1.0, 1.0, 3.0),
    Tested("DB", 1.0, 2.0, 4.0),
)
"""The eight runs; two are in each direction (sec. 5.1), which two the paper does not say."""


def done(found: Found) -> bool:
    """Whether these runs are part of a study."""
    return FIT in found.figures
