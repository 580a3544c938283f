"""The runs that ``tests/same_as.py`` compares: packaged scenarios, plain and with what goes wrong in a field."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

SEEDS: Final = range(1, 6)
TRACKERS: Final = ("fix-imm-ukf", "spcpf", "bootstrap", "fix-doa", "ekf", "ukf", "predict-only")
LIGHT: Final = ("fix-imm-ukf", "spcpf", "ekf", "ukf")
"""Trackers that keep up with five emulated seconds in a second."""
Settings = tuple[str, ...]


@dataclass(frozen=True)
class Case:
    """A run by name, such as ``spcpf-s1-faults-3``, and the arguments of ``trackfield run`` that make it."""

    name: str
    arguments: tuple[str, ...]
    processes: bool = False


@dataclass(frozen=True)
class Field:
    """A scenario with its settings, and those of its variants by their name."""

    scenario: str
    settings: Settings
    variants: Mapping[str, Settings]


def faults(*each: str) -> str:
    """The setting of a list of faults, each ``kind, key=value, ...``."""
    return f"faults=[{', '.join(f'{{kind={one}}}' for one in each)}]"


CLOCKS: Final = ("clock.offset_ms=50", "clock.drift_ppm=20")
LATE: Final = (
    "link.model=gilbert_elliott", "link.delay_ms=150", "link.jitter_ms=300",
    "fusion.max_age_s=3", "fusion.smooth_lag=3",
)  # fmt: skip
FAULTS: Final = faults(
    "'stuck', share=0.05, at_s=2, until_s=10",
    "'freeze', share=0.2, at_s=4, until_s=8.3",
    "'partition', share=0.3, at_s=9, until_s=12",
    "'restart', nodes=['fusion'], at_s=14, until_s=16.5",
    "'babble', nodes=['n060'], at_s=18, until_s=24",
    "'clock_jump', share=0.2, at_s=20, jump_ms=500",
    "'bias', share=0.2, at_s=25, until_s=32, bias_deg=20",
    "'freeze', nodes=['fusion'], at_s=26, until_s=27.2",
    "'clock_jump', nodes=['fusion'], at_s=28, jump_ms=-40",
    "'kill', share=0.2, at_s=30",
    "'deaf', share=0.1, at_s=33",
)
"""Of fields with many sensors; all within the 40 s of s3."""
RADAR_FAULTS: Final = faults(
    "'bias', nodes=['n000'], at_s=40, until_s=90, bias_deg=1",
    "'partition', nodes=['n000'], at_s=95, until_s=125",
    "'stuck', nodes=['n000'], at_s=140, until_s=180",
    "'restart', nodes=['fusion'], at_s=205, until_s=225",
    "'freeze', nodes=['n000'], at_s=255, until_s=285",
    "'babble', nodes=['n000'], at_s=350, until_s=380",
    "'clock_jump', nodes=['n000'], at_s=415, jump_ms=500",
    "'kill', nodes=['n000'], at_s=555",
)


def spcpf(path: str, battery_j: float) -> Field:
    """The paper's field; the battery lasts for sleeping through the run, not for listening often."""
    variants = {
        "plain": (),
        "clocks": CLOCKS,
        "batteries": (f"energy.battery_j={battery_j}", "energy.sample_mj=2"),
        "faults": (FAULTS,),
        "late": LATE,
        "adaptive": ("sensor.threshold=adaptive",),
        "moving": ("link.ack=3", "fusion.path=[[0, 50, 450], [40, 450, 50]]"),
    }
    return Field("spcpf", (f"target.path={path}",), variants)


BUS: Final = {
    "plain": (),
    "clocks": ("clock.offset_ms=400", "clock.drift_ppm=100"),  # it has those of the others as it is
    "batteries": ("energy.battery_j=0.5",),
    "faults": (FAULTS,),
    "late": LATE,
}
RADAR: Final = {
    "plain": (),
    "clocks": CLOCKS,
    "batteries": ("energy.battery_j=3",),
    "faults": (RADAR_FAULTS,),
    "late": (*LATE, "link.delay_ms=20", "link.jitter_ms=4000", "fusion.max_age_s=30"),  # its steps take ten seconds
}
FIELDS: Final = {
    "spcpf-s1": spcpf("s1", 0.47),
    "spcpf-s2": spcpf("s2", 0.575),
    "spcpf-s3": spcpf("s3", 0.315),
    "bus": Field("bus", ("target.steps=60",), BUS),
    "radar": Field("radar", (), RADAR),
}
AS_PROCESSES: Final = ("spcpf-s1", "spcpf-s2", "spcpf-s3", "bus")


def cases() -> Iterator[Case]:
    """All of them: those in virtual time first."""
    for name, field in FIELDS.items():
        for variant in field.variants:
            for seed in SEEDS:
                yield Case(f"{name}-{variant}-{seed}", ("--virtual", *_arguments(name, variant, seed, TRACKERS)))
    for name in AS_PROCESSES:
        arguments = ("--speed", "5", *_arguments(name, "plain", 1, LIGHT))
        yield Case(f"{name}-processes-1", arguments, processes=True)


def settings_of(name: str, variant: str) -> Settings:
    """All that a variant of a field sets; where both set a key, the variant's value."""
    together = FIELDS[name].settings + FIELDS[name].variants[variant]
    return tuple({setting.partition("=")[0]: setting for setting in together}.values())


def _arguments(name: str, variant: str, seed: int, trackers: tuple[str, ...]) -> Iterator[str]:
    yield from (FIELDS[name].scenario, "--seed", str(seed))
    for setting in settings_of(name, variant):
        yield from ("--set", setting)
    for tracker in trackers:
        yield from ("--tracker", tracker)
