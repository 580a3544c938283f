"""A small field of masters and slaves, that runs in a second or two."""

from __future__ import annotations

from pathlib import Path

from launcher.plan.prepare import load, planned
from launcher.records import Plan

SMALL = """
name = "small"
seed = 1
[field]
layout = "random"
nodes = 24
spacing_m = 100.0
[sensor]
kind = "range"
range_m = 800.0
floor_sd_m = 0.1
growth_m = 0.02
[target]
path = "drifting"
start_m = [250.0, 250.0]
half_width_m = 240.0
speed_m_s = 4.0
step_s = 1.0
steps = 60
[link]
model = "fixed"
delay_ms = 20.0
[architecture]
kind = "clusters"
masters = 6
placement = "random"
[fusion]
trackers = ["ukf"]
prior = "paper"
prior_sd = [1.0, 1.0, 0.5, 0.5]
sigma_v = 0.1
deadline_s = 0.4
[run]
setup_s = 15.0
"""
"""Six masters, 24 slaves and a base; m4 leads first, m5 from 6 s on."""


def scenario(folder: Path) -> str:
    """The file of this scenario, in a folder."""
    file = folder / "small.toml"
    file.write_text(SMALL)
    return str(file)


def plan(folder: Path, *settings: str) -> Plan:
    """The plan of a run of it."""
    return planned(load(scenario(folder), settings=settings))
