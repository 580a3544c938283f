"""What trackers bear of any sensor, or of whoever sends as one: the largest and smallest numbers of a report."""

from __future__ import annotations

from typing import Final

import numpy as np
import pytest

from tests.matrix import PRIOR, field, refused, truth_of
from trackfield.filters.rng import generator
from trackfield.filters.trackers import TRACKERS, make_tracker
from trackfield.filters.types import Gaussian, Reports
from trackfield.tracking.following import Following
from trackfield.wire.registry import Number, kind_of_class

FIELDS: Final = ("range", "energy", "rss and energy")
STEPS: Final = 2


def limit(reports: Reports, name: str, *, highest: bool, all_of_them: bool) -> None:
    """Write the end of what a report holds into the first reading of each kind, or into all."""
    kinds = field(name).model.kinds
    for each in reports.readings:
        told = kind_of_class(kinds[each.kind].message).fields[1]  # type: ignore[attr-defined]
        assert isinstance(told, Number)
        which = slice(None) if all_of_them else slice(0, 1)
        each.values[which] = told.scaled.high if highest else told.scaled.low


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("alone", [True, False])
@pytest.mark.parametrize("all_of_them", [True, False])
@pytest.mark.parametrize("highest", [True, False])
@pytest.mark.parametrize(
    ("tracker", "name"),
    [(one, name) for one in TRACKERS for name in FIELDS if not refused(one, field(name))],
)
def test_the_ends_of_what_a_report_holds_leave_finite_numbers(
    tracker: str, name: str, highest: bool, all_of_them: bool, alone: bool
) -> None:
    of = field(name)
    truth, rng = truth_of(of, 5), np.random.default_rng(5)
    following = Following(make_tracker(tracker, None, of.model.dimension), of.model)
    state = following.begin(None if alone else Gaussian(truth[0, :4], PRIOR))
    for step in range(1, STEPS + 1):
        reports = of.heard(truth[step], step, rng)
        limit(reports, name, highest=highest, all_of_them=all_of_them)
        state, estimate = following.step(state, reports, 1.0, generator(5, step))
        if estimate is not None:
            assert np.isfinite(estimate.mean).all()
            assert np.isfinite(estimate.covariance).all()
