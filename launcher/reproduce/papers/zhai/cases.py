"""What is run to reproduce Zhai, Yeary, Havlicek & Fan (2009): fields, targets, and trackers side by side.

The link is ideal, as the paper leaves the radio out; messages pass through their encoded bytes all the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final

from launcher.reproduce.case import Case, Options

NOMINALS: Final = (1, 2, 5, 10, 15, 20, 30, 40)
"""The sweep of N, filters in the bank; 15 is SP-CPF's own."""
PARTICLES: Final = (25, 50, 100, 200, 400, 1000, 2000)
"""The sweep of Ns; 200 is SP-CPF's own."""
MAIN: Final = ("spcpf", "bootstrap", "fix-imm-ukf")
ALL: Final = (*MAIN, "ekf", "ukf", "fix-doa", "predict-only")


def nominals(n: int) -> str:
    """The tracker's name in the sweep of N."""
    return "spcpf" if n == 15 else f"spcpf-n{n}"


def particles(n: int) -> str:
    """The tracker's name in the sweep of Ns."""
    return "spcpf" if n == 200 else f"spcpf-ns{n}"


SWEEPS: Final[Mapping[str, Options]] = {
    **{nominals(n): {"tracker": "spcpf", "nominals": n} for n in NOMINALS if n != 15},
    **{particles(n): {"tracker": "spcpf", "particles": n} for n in PARTICLES if n != 200},
}
TENTH: Final[Mapping[str, Options]] = {"bootstrap-200": {"tracker": "bootstrap", "n": 200}}
"""A bootstrap filter with as few particles as SP-CPF."""

SINGLE: Final[Mapping[str, Options]] = {"spcpf-paper": {"tracker": "spcpf", "single": "paper"}}
"""SP-CPF that weighs its particles by p(y | x) alone even when a single sensor reports, as the paper says."""


def _plain(*names: str) -> dict[str, Options]:
    return {name: {} for name in names}


def _acoustic(name: str, path: str, threshold: float, trackers: Mapping[str, Options], **more: Any) -> Case:
    settings = {
        "link.model": "ideal",
        "energy.device": "cc2420-20dbm",
        "fusion.prior": "paper",
        "target.path": path,
        "sensor.threshold": threshold,
        **{f"fusion.{key}": value for key, value in more.items()},
    }
    return Case(name, settings, trackers, "zhai-spcpf")


RADAR: Final[Mapping[str, Any]] = {
    "name": "radar",
    "field": {"layout": "grid", "extent_m": 0.0},
    "sensor": {"threshold": 0.0, "doa_sd_deg": 0.2},
    "target": {"path": "waypoints", "waypoints": [[0, -9000, 12000], [240, 9000, 9600]], "step_s": 4.0},
    "fusion": {"prior": "paper", "prior_sd": [100.0, 100.0, 2.0, 2.0], "sigma_v": 0.05},
}
"""One sensor at (0, 0), a bearing every 4 s, an aircraft at (75, -10) m/s past it in a straight line."""


def _cases() -> list[Case]:
    rival = {**_plain("spcpf", "bootstrap"), **TENTH}
    return [
        _acoustic("s1", "s1", 0.75, {**_plain(*ALL), **SWEEPS, **TENTH}),
        _acoustic("s1-72", "s1", 0.72, _plain(*MAIN)),
        _acoustic("s1-78", "s1", 0.78, {**_plain(*MAIN), **SINGLE}),
        _acoustic("s1-79", "s1", 0.79, _plain("spcpf")),
        *(_acoustic(path, path, 0.75, _plain(*ALL)) for path in ("s2", "s3")),
        *(_acoustic(f"{path}-78", path, 0.78, {**_plain("spcpf", "fix-imm-ukf"), **SINGLE}) for path in ("s2", "s3")),
        _acoustic("s1-narrow", "s1", 0.75, rival, prior_sd=[2.0, 2.0, 0.4, 0.4]),
        *(_acoustic(f"{path}-agile", path, 0.75, rival, sigma_v=1.5) for path in ("s2", "s3")),
        Case(
            "radar",
            {},
            {
                **_plain("predict-only", "ekf", "ukf", "bootstrap", "spcpf"),
                **SINGLE,
            },
            RADAR,
        ),
    ]


CASES: Final[Mapping[str, Case]] = MappingProxyType({case.name: case for case in _cases()})
