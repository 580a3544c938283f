"""Fixed-lag smoothing: the target's position some steps ago, given the reports since then.

A track's last beliefs are kept, and the smoother of Rauch, Tung & Striebel goes back over them
(``trackfield/filters/rts.py``) with the motion that the tracker itself predicted at each step. So only trackers with a
method ``motion`` can be smoothed.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final, Generic, NamedTuple, Protocol, TypeVar, runtime_checkable

import numpy as np

from trackfield.filters import rts
from trackfield.filters.belief import Belief
from trackfield.filters.gaussian import Motion
from trackfield.filters.solving.solver import Closed
from trackfield.filters.types import Estimate, Gaussian, Reports
from trackfield.tracking.following import Followed, Following

S = TypeVar("S")


@runtime_checkable
class Foresees(Protocol):
    """A tracker that provides the motion that it predicted."""

    def motion(self, before: Any, after: Any, dt: float) -> Motion:
        """The linear motion between two of its states, ``dt`` seconds apart, with the moments of the prediction."""
        ...


class Filtered(NamedTuple):
    """The belief about a step, the reports behind it, and the motion that led there (None: the track began)."""

    reports: Reports
    belief: Gaussian
    motion: Motion | None


class Lagged(NamedTuple, Generic[S]):
    """A track, and its last beliefs: at most one more than the lag, all of them since the track began."""

    followed: Followed[S]
    window: tuple[Filtered, ...] = ()

    @property
    def track(self) -> S | None:
        """The tracker's state; None while waiting."""
        return self.followed.track

    @property
    def known(self) -> bool:
        """Whether anything is known of the target."""
        return self.followed.known is not None


class Earlier(NamedTuple):
    """The smoothed estimate of a step, and the reports of that step."""

    reports: Reports
    estimate: Estimate


class Advanced(NamedTuple, Generic[S]):
    """After a step: the state, the estimate of the step (None without a track), that of ``lag`` steps before."""

    state: Lagged[S]
    estimate: Estimate | None
    earlier: Earlier | None


@dataclass(frozen=True)
class Smoothing(Generic[S]):
    """Follows a target, and smooths the track over ``lag`` steps; 0: no smoothing."""

    following: Following[S]
    lag: int = 0

    def begin(self, prior: Gaussian | None) -> Lagged[S]:
        """As ``Following.begin``."""
        return Lagged(self.following.begin(prior))

    def belief(self, state: Lagged[S]) -> Belief | None:
        """As ``Following.belief``."""
        return self.following.belief(state.followed)

    def closed(self, state: Lagged[S]) -> Closed | None:
        """As ``Following.closed``."""
        return self.following.closed(state.followed)

    def resume(self, belief: Belief) -> Lagged[S]:
        """As ``Following.resume``: steps before the pause are no longer smoothed."""
        return Lagged(self.following.resume(belief))

    def step(self, state: Lagged[S], reports: Reports, dt: float, rng: np.random.Generator) -> Advanced[S]:
        """As ``Following.step``; the earlier estimate is available once the track is older than the lag."""
        tracker, before = self.following.tracker, state.track
        followed, estimate = self.following.step(state.followed, reports, dt, rng)
        if not self.lag or not isinstance(tracker, Foresees) or estimate is None or not _finite(estimate):
            return Advanced(Lagged(followed), estimate, None)
        motion = None if followed.new else tracker.motion(before, followed.track, dt)
        now = Filtered(reports, Gaussian(estimate.mean, estimate.covariance), motion)
        window = (now,) if motion is None else (*state.window, now)[-self.lag - 1 :]
        earlier = smoothed(window) if len(window) > self.lag else None
        return Advanced(Lagged(followed, window), estimate, earlier)


def smoothed(window: tuple[Filtered, ...]) -> Earlier:
    """The oldest step of the window, given the reports of all its steps."""
    beliefs = Gaussian(*(np.stack(parts) for parts in zip(*(one.belief for one in window), strict=True)))
    ways = [one.motion for one in window[1:] if one.motion is not None]
    motions = Motion(*(np.stack(parts) for parts in zip(*ways, strict=True)))
    mean, covariance = rts.smooth(beliefs, motions)
    return Earlier(window[0].reports, Estimate(mean[0], covariance[0]))


def lagged_name(tracker: str, lag: int) -> str:
    """The name of the smoothed track of a tracker."""
    return f"{tracker}+lag{lag}"


def lagged_names(trackers: Iterable[tuple[str, object]], lag: int) -> tuple[str, ...]:
    """The names of the smoothed tracks of these (name, tracker)."""
    return tuple(lagged_name(name, lag) for name, tracker in trackers if lag and isinstance(tracker, Foresees))


RTS: Final = "+rts"
"""The end of the name of a track that is smoothed as a whole (``trackfield/tracking/intervals.py``)."""

SPLINE: Final = "+spline"
"""That of one that is a spline through the reports of several events (``fusion/splines.py``)."""
WHOLE: Final = (RTS, SPLINE)
"""The ends of names of tracks that are published as a whole, at their end."""
WHOLE_PATTERN: Final = r"\+(rts|spline)$"
"""The same as a regular expression."""


def spline_name(tracker: str) -> str:
    """The name of a tracker's track as a spline."""
    return f"{tracker}{SPLINE}"


def rts_name(tracker: str) -> str:
    """The name of a tracker's track smoothed as a whole."""
    return f"{tracker}{RTS}"


def rts_names(trackers: Iterable[tuple[str, object]]) -> tuple[str, ...]:
    """The names of such tracks of these (name, tracker)."""
    return tuple(rts_name(name) for name, tracker in trackers if isinstance(tracker, Foresees))


def _finite(estimate: Estimate) -> bool:
    return bool(np.isfinite(estimate.mean).all() and np.isfinite(estimate.covariance).all())
