"""The input of all filters of the benchmark: the paper's first scenario, four bearings in each step."""

from __future__ import annotations

from math import radians
from typing import Final, NamedTuple

import numpy as np

from trackfield.filters.types import Array, Gaussian, Model, Reports, of_bearings
from trackfield.scenario import Scenario, survey

STEPS: Final = 60
BEARINGS: Final = 4
"""Of the sensors nearest to the target, as many as report on average at the scenario's own threshold."""
DT: Final = 1.0
SD_DEG: Final = 3.0
"""Of a bearing."""


class Track(NamedTuple):
    """``truth`` (T, 4) and, of each step, ``sensors`` (T, K, 2) m and ``bearings`` (T, K) rad; T=60, K=4."""

    truth: Array
    sensors: Array
    bearings: Array
    prior: Gaussian
    model: Model

    @property
    def reports(self) -> list[Reports]:
        """The same as a tracker gets them, all with the same level."""
        names, levels = tuple("abcd"[:BEARINGS]), np.full(BEARINGS, 55.0)
        steps = zip(self.sensors, self.bearings, strict=True)
        return [of_bearings(k, names, where, angles, levels) for k, (where, angles) in enumerate(steps, start=1)]

    def first(self, steps: int) -> Track:
        """Its first steps."""
        return self._replace(truth=self.truth[:steps], sensors=self.sensors[:steps], bearings=self.bearings[:steps])


def track(seed: int = 1) -> Track:
    """The track and its bearings, as the sensors of ``zhai-spcpf`` hear them."""
    scenario = Scenario.load(
        "zhai-spcpf", {"seed": seed, "target.path": "s1", "sensor.threshold": 0.5, "sensor.doa_sd_deg": SD_DEG}
    )
    site = survey(scenario)
    places = np.array([place[1:] for place in site.sensors])
    truth, sensors, bearings = [], [], []
    for step in range(1, STEPS + 1):
        state = site.paths["target"].at(step * DT)
        if state is None:
            raise ValueError(f"no target at step {step}")
        near = np.argsort(np.hypot(*(places - state[:2]).T))[:BEARINGS]
        heard = [site.sensor(int(i)).sample(step * site.step_ns) for i in near]
        truth.append(state)
        sensors.append(places[near])
        bearings.append([radians(one.values[0]) for one in heard if one is not None])
    begin, sd = site.paths["target"].at(0.0), np.array(scenario.fusion.prior_sd)
    prior = Gaussian(np.array(begin), np.diag(np.square(sd)))
    model = Model({"doa": scenario.sensor.sensing}, scenario.fusion.sigma_v)
    return Track(np.array(truth), np.array(sensors), np.array(bearings), prior, model)
