"""A small field in which any node may lead, that runs in a few seconds."""

from __future__ import annotations

from pathlib import Path

SMALL = """
name = "small"
seed = 1
[field]
layout = "random"
nodes = 24
spacing_m = 40.0
[sensor]
kind = "range"
range_m = 90.0
floor_sd_m = 0.5
growth_m = 0.02
[target]
path = "drifting"
start_m = [100.0, 100.0]
half_width_m = 90.0
speed_m_s = 4.0
step_s = 1.0
steps = 40
[link]
model = "fixed"
delay_ms = 20.0
[architecture]
kind = "elected"
[energy]
battery_j = 1000.0
[fusion]
trackers = ["ukf"]
sigma_v = 0.1
deadline_s = 0.4
"""
"""24 nodes and a base."""


def scenario(folder: Path) -> str:
    """The file of this scenario, in a folder."""
    file = folder / "small.toml"
    file.write_text(SMALL)
    return str(file)
