"""One belief of several that were made of one prior, or whose errors depend on each other in an unknown way.

In a cluster whose members filter, each updates the head's last estimate with its own reading, so all their beliefs hold
that estimate. The product of the beliefs counts it m times; taken off m - 1 times, the product is that of one prior
and all readings (Hashemipour, Roy & Laub 1988, for Kalman filters): P^-1 = sum P_i^-1 - (m - 1) P_0^-1. It takes that
all have the same prior, and that the errors of their readings are independent. Covariance intersection (Julier &
Uhlmann 1997) takes neither: P^-1 = sum w_i P_i^-1 with weights that sum to 1 is never overconfident if no belief is.

States hold no angles, whose differences would have to be wrapped.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, Literal, NamedTuple

import numpy as np

from trackfield.filters.types import Array, Gaussian

Way = Literal["product", "intersection"]
Size = Literal["determinant", "trace"]

LEAST_EIGENVALUE: Final = 1e-11
"""Of a matrix of correlations. With less it is as good as singular: rounding decides what its inverse is."""
LEAST_INFORMATION: Final = 0.1
"""Of a product, in any direction, as a share of the prior's. With less, beliefs are together much less certain than
what all of them began with, so that they cannot have been made of it."""
MOST: Final = 1e100
"""Numbers beyond this are no beliefs, nor variances below its reciprocal: sums and products of them stay finite."""
_ROUNDS: Final = 200
_ENOUGH: Final = 1e-3
"""How near to the best weights are good enough; any give a belief that is not overconfident."""


class Combined(NamedTuple):
    """A ``belief``, and the ``way`` in which it came about: another than was asked for where that has no answer.

    "prior" says that there was nothing to combine. ``left_out`` are the numbers of the beliefs that could not be used.
    """

    belief: Gaussian
    way: Way | Literal["prior"]
    left_out: tuple[int, ...] = ()


def combined(way: Way, beliefs: Sequence[Gaussian], prior: Gaussian) -> Combined:
    """The ``beliefs`` of members, means (n,) and covariances (n, n), that were made of this ``prior``.

    A belief that is not finite, of another size, or whose covariance is singular or none, is left out. Where the
    product has no answer, as the prior is of no use or the beliefs cannot come of it, the intersection stands in.
    """
    good = [usable(belief, len(prior.mean)) for belief in beliefs]
    left_out = tuple(i for i, one in enumerate(good) if not one)
    kept = [belief for belief, one in zip(beliefs, good, strict=True) if one]
    if not kept:
        return Combined(prior, "prior", left_out)
    if way == "product" and (found := product(kept, prior)) is not None:
        return Combined(found, "product", left_out)
    return Combined(intersection(kept), "intersection", left_out)


def usable(belief: Gaussian, n: int) -> bool:
    """Whether it is of ``n`` finite numbers, and its covariance has an inverse that can be computed."""
    mean, covariance = belief
    if mean.shape != (n,) or covariance.shape != (n, n):
        return False
    variances = np.diagonal(covariance)
    if not ((np.abs(mean) < MOST).all() and (np.abs(covariance) < MOST).all() and (variances > 1.0 / MOST).all()):
        return False  # NaN neither
    sd = np.sqrt(variances)
    return bool(np.linalg.eigvalsh(_even(covariance / sd / sd[:, None]))[0] > LEAST_EIGENVALUE)


def product(beliefs: Sequence[Gaussian], prior: Gaussian) -> Gaussian | None:
    """P^-1 = sum P_i^-1 - (m - 1) P_0^-1, and the mean that goes with it; None if that is no belief.

    The ``beliefs`` must be usable. Computed in coordinates in which the prior is N(0, I), so that what a belief adds to
    it is not lost in rounding.
    """
    if not usable(prior, len(prior.mean)):
        return None
    try:
        with np.errstate(all="ignore"):  # what rounding has spoilt is found out by its eigenvalues
            return _product(beliefs, prior)
    except np.linalg.LinAlgError:
        return None


def _product(beliefs: Sequence[Gaussian], prior: Gaussian) -> Gaussian | None:
    root = np.linalg.cholesky(_even(prior.covariance))
    information, vector = -(len(beliefs) - 1.0) * np.eye(len(root)), np.zeros(len(root))
    for mean, covariance in beliefs:
        white = _even(np.linalg.solve(root, np.linalg.solve(root, _even(covariance)).T))
        own = _inverse(white)
        information = information + own
        vector = vector + own @ np.linalg.solve(root, mean - prior.mean)
    values, directions = np.linalg.eigh(_even(information))
    if not values[0] >= LEAST_INFORMATION:
        return None
    white = directions / np.sqrt(values)
    spread = root @ white
    found = Gaussian(prior.mean + spread @ (white.T @ vector), spread @ spread.T)
    return found if usable(found, len(prior.mean)) else None


def intersection(beliefs: Sequence[Gaussian], size: Size = "determinant") -> Gaussian:
    """P^-1 = sum w_i P_i^-1, with the weights that make P the smallest, and P^-1 x = sum w_i P_i^-1 x_i.

    The ``beliefs``, one or more, must be usable. By the determinant the weights do not depend on the units; the trace
    adds square metres to squares of speeds. Where rounding spoils it, the belief with the smallest determinant is
    returned: an intersection, too.
    """
    try:
        with np.errstate(all="ignore"):
            found = _intersection(beliefs, size)
        if usable(found, len(found.mean)):
            return found
    except np.linalg.LinAlgError:
        pass
    return min(beliefs, key=lambda belief: float(np.linalg.slogdet(belief.covariance)[1]))


def _intersection(beliefs: Sequence[Gaussian], size: Size) -> Gaussian:
    sd = np.sqrt(np.mean([np.diagonal(covariance) for _, covariance in beliefs], axis=0))
    scale = sd * sd[:, None]
    informations = np.array([_inverse(_even(covariance / scale)) for _, covariance in beliefs])
    w = weights(informations, np.square(sd) if size == "trace" else None)
    covariance = _inverse(np.einsum("m,mij->ij", w, informations))
    origin = beliefs[0].mean
    apart = np.array([(mean - origin) / sd for mean, _ in beliefs])
    vector = np.einsum("m,mij,mj->i", w, informations, apart)
    return Gaussian(origin + sd * (covariance @ vector), covariance * scale)


def weights(informations: Array, squares: Array | None = None) -> Array:
    """Weights (m,) of the ``informations`` (m, n, n) whose sum S has the largest determinant.

    With ``squares`` (n,), the sum of these times the diagonal of S^-1 is the smallest. Weights of an optimal design of
    experiments, by the multiplicative algorithm, which never makes them worse (Silvey, Titterington & Torsney 1978); by
    the equivalence theorem (Kiefer 1974) it knows when none are better by more than a thousandth in each dimension.
    """
    m, n = informations.shape[:2]
    w = np.full(m, 1.0 / m)
    for _ in range(_ROUNDS if m > 1 else 0):
        covariance = _inverse(np.einsum("m,mij->ij", w, informations))
        if squares is None:
            gains = np.einsum("ij,mji->m", covariance, informations) / n
        else:
            inner = covariance * squares @ covariance
            gains = np.einsum("ij,mji->m", inner, informations) / (np.diagonal(covariance) @ squares)
        if gains.max() <= 1.0 + _ENOUGH:
            break
        w = w * (gains if squares is None else np.sqrt(gains))
        w = w / w.sum()
    return w


def _inverse(matrix: Array) -> Array:
    """Of a symmetric matrix (n, n) that is positive definite."""
    return _even(np.asarray(np.linalg.inv(matrix), float))


def _even(matrix: Array) -> Array:
    """Symmetric, whatever rounding has made of it."""
    found: Array = (matrix + matrix.T) / 2.0
    return found
