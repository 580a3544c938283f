"""The study with nodes that elect a head and exchange messages: whole runs in virtual time of ``zhou-upf``.

Trackers run side by side on the same reports; the first of them decides who measures.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Final

from launcher.reproduce.kernels.study import Experiment, Found
from launcher.reproduce.papers.zhou import outlying
from launcher.reproduce.papers.zhou.setups import LINEAR, OUTLIERS, PAPERLIKE, RSS, SHARP, WALK, Setup
from launcher.reproduce.papers.zhou.whole import run
from trackfield.tracking.smoothing import RTS

MOST: Final = 100
"""Runs of each; one takes 10 to 60 s of processor time."""
ROLES: Final = ", roles"
"""After the names of experiments, which bare filters have, too."""
FIRST: Final = "gpf-ukf"
SMOOTHED: Final = RTS
TRACKERS: Final = (FIRST, "upf", "fa-upf", "upf-paper", "ukf", "bootstrap-100")
TWO: Final = (FIRST, "ukf")
ROBUST: Final = ("ukf-robust", "ukf", "gpf-ukf-robust", FIRST)
OPTIONS: Final[Mapping[str, Mapping[str, Any]]] = {
    "bootstrap-100": {"tracker": "bootstrap", "n": 100},
    "ukf-robust": {"tracker": "ukf", "robust": True},
    "gpf-ukf-robust": {"tracker": "gpf-ukf", "robust": True},
}
"""Those of trackers that are variants of others."""


@dataclass(frozen=True)
class Whole:
    """An experiment about a ``setup``: its ``changes`` of the packaged scenario, and ``options`` of trackers."""

    setup: Setup
    trackers: tuple[str, ...]
    changes: Mapping[str, Any] = field(default_factory=dict)
    options: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    @property
    def experiment(self) -> Experiment:
        """Its runs, one at a time."""
        options = {name: {**OPTIONS.get(name, {}), **self.options.get(name, {})} for name in self.trackers}
        changes = {
            "target.steps": self.setup.steps,
            "fusion.trackers": list(self.trackers),
            "fusion.options": {name: some for name, some in options.items() if some},
        }
        return Experiment(partial(run, self.setup, {**changes, **self.changes}), batch=1, most=MOST, roles=True)

    @property
    def bounded(self) -> bool:
        """Whether the posterior bound holds: the target moves as filters expect, and readings are without outliers."""
        return self.setup.true_q is None and not self.setup.outliers


def _sd(sd: float) -> dict[str, Any]:
    return {"target.start_sd": [sd] * 4, "fusion.prior_sd": [sd] * 4}


def _moved(setup: Setup) -> dict[str, Any]:
    """The key q of the packaged scenario is a spectral density, m^2/s^3; steps are of 1 s."""
    return {"target.q": setup.q**2, "fusion.sigma_v": setup.q, "sensor.floor_sd_m": setup.noise}


_FAR: Final[Mapping[str, Any]] = {
    "field.spacing_m": PAPERLIKE.cell_m,
    "field.within_m": 2 * PAPERLIKE.sense_m,
    "sensor.range_m": PAPERLIKE.sense_m,
    "fusion.lost_m": PAPERLIKE.sense_m,
    "score.lost.beyond_m": PAPERLIKE.sense_m,
    "link.radio": "802154-20dbm",
}
_MAIN: Final = {
    "walk": Whole(WALK, TRACKERS, {"fusion.smooth_rts": True}),
    "sharp": Whole(SHARP, TRACKERS, {**_moved(SHARP), **_sd(SHARP.prior_sd[0])}),
    "linear": Whole(LINEAR, TRACKERS, {"target.q": 0.0}),
    "paperlike": Whole(PAPERLIKE, TRACKERS, {**_moved(PAPERLIKE), **_sd(PAPERLIKE.prior_sd[0]), **_FAR}),
}
_RSS: Final = {
    name: Whole(setup, ("ukf", FIRST), {"sensor": {"kind": "rss", "range_m": 20.0, "shadow_sd_db": setup.noise}})
    for name, setup in RSS.items()
}
_OUTLIERS: Final = {
    "outliers": Whole(
        OUTLIERS,
        ROBUST,
        {
            "sensor": {
                "kind": outlying.KIND,
                "range_m": 20.0,
                "floor_sd_m": 1.0,
                "growth_m": 0.0,
                "outliers": OUTLIERS.outliers,
            }
        },
    )
}
READINGS, PRODUCT, INTERSECTION = "readings", "local, product", "local, intersection"
GAUSSIAN, PARTICLES = "hand-over of mean and covariance", "hand-over of particles"
IDLE: Final = "no target"
_EARLIER: Final = {"fusion.deadline_s": 0.4}
"""Particles take half a second to be handed over."""
_KEPT: Final = {"upf": {"keeps": "particles"}}
"""Within a head's turn they are kept in either case."""
_FORMS: Final = {
    READINGS: Whole(WALK, TWO),
    PRODUCT: Whole(WALK, TWO, {"architecture.local": True, "architecture.combine": "product"}),
    INTERSECTION: Whole(WALK, TWO, {"architecture.local": True, "architecture.combine": "intersection"}),
    GAUSSIAN: Whole(WALK, ("upf",), {**_EARLIER, "architecture.handover": "gaussian"}, _KEPT),
    PARTICLES: Whole(WALK, ("upf",), {**_EARLIER, "architecture.handover": "particles"}, _KEPT),
}
_IDLE: Final = {IDLE: Whole(WALK, (FIRST,), {"faults": [{"kind": "deaf", "share": 1.0, "at_s": 0.0}]})}
WHOLE: Final[Mapping[str, Whole]] = {
    f"{name}{ROLES}": one for name, one in {**_MAIN, **_RSS, **_OUTLIERS, **_FORMS, **_IDLE}.items()
}
MAIN, LEVELS, FORMS = ([f"{name}{ROLES}" for name in some] for some in (_MAIN, _RSS, _FORMS))
EXPERIMENTS: Final = {name: one.experiment for name, one in WHOLE.items()}


def done(found: Found) -> bool:
    """Whether these runs are part of a study."""
    return any(name in found.figures for name in WHOLE)
