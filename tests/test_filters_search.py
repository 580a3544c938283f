"""Where tracks begin with any kind of sensing: the search of the place that the readings of a step say."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.rangers import Distance, Ranger
from tests.sensing import model_of, reports_of
from trackfield.filters.metrics import LOST_M
from trackfield.filters.search import searched
from trackfield.filters.types import Reports
from trackfield.tracking.following import ANYWHERE


def ranges(target: tuple[float, float], positions: list[tuple[float, float]], sensor: Any) -> Reports:
    """What sensors at these positions read of a target, without noise."""
    at = np.array(positions).reshape(-1, 2)
    return reports_of(at, sensor.h(np.array([*target, 0.0, 0.0]), at))


SQUARE = [(0.0, 0.0), (50.0, 0.0), (0.0, 50.0), (50.0, 50.0)]


def test_the_fix_is_where_the_readings_say() -> None:
    model = model_of(Distance())
    for target in ((20.0, 30.0), (70.0, -40.0), (25.0, 25.0), (50.0, 49.0)):
        fix = searched(ANYWHERE, model, ranges(target, SQUARE, Distance()), LOST_M)
        assert fix is not None
        assert fix.mean[:2] == pytest.approx(target, abs=0.01)
        H = Distance().jacobian(fix.mean, np.array(SQUARE))[:, 0] / 0.5
        assert fix.covariance == pytest.approx(np.linalg.inv(np.linalg.inv(ANYWHERE) + H.T @ H), rel=1e-6)


def test_readings_that_fit_several_places_are_no_fix() -> None:
    model = model_of(Distance())
    assert searched(ANYWHERE, model, ranges((20.0, 30.0), [], Distance()), LOST_M) is None
    assert searched(ANYWHERE, model, ranges((20.0, 30.0), SQUARE[:1], Distance()), LOST_M) is None  # a circle
    assert searched(ANYWHERE, model, ranges((20.0, 30.0), SQUARE[:2], Distance()), LOST_M) is None  # mirrored at y = 0
    assert searched(ANYWHERE, model, ranges((20.0, 0.0), SQUARE[:2], Distance()), LOST_M) is None  # y is open
    assert searched(ANYWHERE, model, ranges((20.0, 30.0), SQUARE[:3], Distance()), LOST_M) is not None
    assert searched(ANYWHERE, model_of(Ranger()), ranges((9.0, 30.0), SQUARE[:1], Ranger()), LOST_M) is None
