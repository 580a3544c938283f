"""Trackers by name: Trackfield's own, and those that users register or install."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from trackfield.errors import ScenarioError
from trackfield.filters.bootstrap import Bootstrap
from trackfield.filters.checked import checked
from trackfield.filters.fa_upf import FaUpf
from trackfield.filters.fix_doa import FixDoa
from trackfield.filters.gpf_ukf import GpfUkf
from trackfield.filters.imm_ukf import ImmUkf
from trackfield.filters.jm_rbpf import JmRbpf
from trackfield.filters.measurement import STATE
from trackfield.filters.mrbpf import Mrbpf
from trackfield.filters.mrbpf_weightmass import MrbpfWeightmass
from trackfield.filters.rbpf import Rbpf
from trackfield.filters.single_model import Ekf, PredictOnly, Ukf
from trackfield.filters.solving.solver import Cpa, Ecpa, Ml
from trackfield.filters.spcpf import SpCpf
from trackfield.filters.types import Tracker
from trackfield.filters.upf import Upf
from trackfield.filters.upf_paper import UpfPaper
from trackfield.options import made
from trackfield.plugins import Maker, Plugins

NOT_ROBUST: Final = {
    "fix-doa": "it draws from the likeliest place for all bearings together, outliers included",
    "upf-paper": "it is the filter as Zhou et al. (2011) print it, to compare others with",
    "predict-only": "it takes no readings",
    **dict.fromkeys(("cpa", "ecpa"), "it takes the readings of an event for those of a pass, or none of them"),
    "ml": "it always is: it leaves out the reading that does not fit the others",
}
"""Trackers without the option ``robust`` of the others, and why."""
TRACKERS: Final = Plugins(
    "tracker",
    "trackfield.trackers",
    {
        "imm-ukf": ImmUkf,
        "spcpf": SpCpf,
        "bootstrap": Bootstrap,
        "fix-doa": FixDoa,
        "rbpf": Rbpf,
        "mrbpf": Mrbpf,
        "mrbpf-weightmass": MrbpfWeightmass,
        "jm-rbpf": JmRbpf,
        "ekf": Ekf,
        "ukf": Ukf,
        "gpf-ukf": GpfUkf,
        "upf": Upf,
        "fa-upf": FaUpf,
        "upf-paper": UpfPaper,
        "cpa": Cpa,
        "ecpa": Ecpa,
        "ml": Ml,
        "predict-only": PredictOnly,
    },
    methods=("init", "step"),
    former={"fix-imm-ukf": "imm-ukf"},
)


def register_tracker(name: str, maker: Maker) -> None:
    """Let scenarios of this Python process name a tracker of your own (``trackfield.filters.types.Tracker``).

    ``maker`` is its class; ``fusion.options`` may set its parameters, such as the fields of a frozen dataclass.
    Runs over processes need a class that can be imported. Raises ``ScenarioError`` for a name that is taken by one of
    Trackfield's own, and for a class without ``init`` and ``step``.
    """
    TRACKERS.register(name, maker)


def make_tracker(name: str, options: Mapping[str, Any] | None = None, n: int = STATE) -> Tracker[Any]:
    """The tracker of this name with these ``options``; an option ``tracker`` makes it a variant of that tracker.

    Users' own trackers are returned as ``Checked``, for states of ``n`` numbers. Raises ``ScenarioError`` with the
    nearest name for an unknown tracker, and for unknown or unsuitable options, and says why one cannot be ``robust``.
    """
    fields = dict(options or {})
    kind = fields.pop("tracker", name)
    key = f"fusion.options.{name}"
    if kind not in TRACKERS:
        raise TRACKERS.unknown(kind, f"{key}.tracker" if kind != name else "fusion.trackers")
    if "robust" in fields and kind in NOT_ROBUST:
        what = f"{kind} cannot be robust to outliers: {NOT_ROBUST[kind]}"
        raise ScenarioError(what, key=f"{key}.robust", expected="gpf-ukf, or another tracker with this option")
    tracker: Tracker[Any] = made(TRACKERS[kind], fields, key)
    return tracker if TRACKERS.owns(kind) else checked(name, tracker, n)
