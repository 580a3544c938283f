"""The map of a report: the largest error close by, ellipses, names and the hearing radius, and its scale."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.patches import Circle, Ellipse

from launcher.report.figures import FIGURES
from launcher.report.folder import Run, read_run
from tests.reporting import read, run, troubled
from tests.test_report_targets import drawn, labels

__all__ = ["troubled"]


@pytest.fixture
def read_troubled(troubled: Path) -> Run:
    return read_run(troubled)


def test_the_largest_error_is_shown_close_by(read_troubled: Run) -> None:
    track = next(track for track in read_troubled.tracks if track.scored.any())
    worst = int(np.nanargmax(track.error_m))
    figure = FIGURES["field"](read_troubled)
    assert figure is not None
    (near,) = [axes for axes in figure.axes if axes.get_title("left").startswith("largest error")]
    assert near.get_title("left").startswith(f"largest error of {track.tracker},")
    assert near.get_title("left").endswith(f"at {track.t_s[worst]:g} s")
    for place in (track.mean[worst], track.truth[worst]):
        assert near.get_xlim()[0] < place[0] < near.get_xlim()[1]
        assert near.get_ylim()[0] < place[1] < near.get_ylim()[1]


def test_ellipses_are_those_of_the_covariances(read_troubled: Run) -> None:
    axes, track = drawn("field", read_troubled), read_troubled.tracks[0]
    found = [patch for patch in axes.patches if isinstance(patch, Ellipse) and not isinstance(patch, Circle)]
    assert found
    first = next(one for one in found if np.allclose(one.get_center(), track.mean[0, :2]))
    values = np.linalg.eigvalsh(track.covariance[0, :2, :2])
    assert sorted((first.width / 2, first.height / 2)) == pytest.approx(np.sqrt(5.991465 * values).tolist(), rel=1e-6)


def test_the_map_has_names_and_the_hearing_radius(read_troubled: Run) -> None:
    axes = drawn("field", read_troubled)
    assert "hearing radius, 56 m" in labels(axes)
    (circle,) = [patch for patch in axes.patches if isinstance(patch, Circle)]
    assert circle.radius == pytest.approx(56.2, abs=0.1)
    named = {text.get_text() for text in axes.texts}
    assert len(named) > 2
    assert named <= read_troubled.frames.senders()


def test_a_large_field_is_in_kilometres(tmp_path: Path) -> None:
    """And an aircraft beside a radar is no vehicle among microphones: nothing of the page says so."""
    folder = run(tmp_path / "radar", scenario="radar")
    axes = drawn("field", read_run(folder))
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("east [km]", "north [km]")
    assert "hearing radius" not in " ".join(labels(axes))
    assert "sensing bearing (sd 0.2°) and level, any distance" in read(folder).text
