"""What is claimed of the camera: that it captures the target, and that it takes a prediction to do so."""

from __future__ import annotations

from typing import Final

from launcher.reproduce.intervals import all_of
from launcher.reproduce.kernels.study import Found
from launcher.reproduce.papers.yang.camera import whole
from launcher.reproduce.papers.yang.camera.aimed import NEAR, camera_case
from launcher.reproduce.papers.yang.camera.tables import (
    AT_S,
    COMPARED,
    END_FAST,
    END_LOST,
    END_SEEN,
    LOST,
    SEEN,
    share_of_passes,
    share_seen,
)
from launcher.reproduce.papers.yang.claims import in_part
from launcher.reproduce.papers.yang.scores import mean_error
from launcher.reproduce.papers.yang.trials.field import SPEED
from launcher.reproduce.tables import Claim, percent, verdict, with_interval

CAPTURED: Final = 0.9
"""The share of the passes that should be in the picture."""


def claims(found: Found) -> list[Claim]:
    """All of them; without roles only the first."""
    return [_predicted(found), *([judge(found) for judge in _WHOLE] if whole.done(found) else ())]


def _share(found: Found, name: str) -> str:
    return with_interval(share_of_passes(found, name), percent)


def _predicted(found: Found) -> Claim:
    answers, told = [], []
    for line in COMPARED:
        case = camera_case(line, SPEED)
        seen, lost = (share_seen(found, case, way, NEAR, AT_S) for way in ("with", "without"))
        answers.append(all_of((SEEN.holds(seen), LOST.holds(lost))))
        told.append(f"{line} with {with_interval(seen, percent)}, without {with_interval(lost, percent)}")
    return Claim(
        "The camera control node predicts where the target is (sec. 4.1); it has to",
        f"of the trials at 30 mph with a fix, {AT_S:g} s after the last CPA, the target is in the picture of a camera "
        f"at {NEAR} in at least {SEEN.low:.0%} with prediction and at most {LOST.high:.0%} without, from A to C and on "
        "any line; in part: on one of them",
        "; ".join(told),
        in_part(answers),
    )


def _captured(found: Found) -> Claim:
    cameras = {name: share_of_passes(found, name) for name in (whole.PACKAGED, whole.ALL_FAR)}
    return Claim(
        "With roles: the camera captures images of the target at its predicted location, on both lines, to and fro",
        f"from sound to the picture, the target is in it in at least {CAPTURED:.0%} of the passes of Table 1, from "
        "both places of the camera; in part: from one",
        "; ".join(f"{whole.view_of(name)} {with_interval(one, percent)}" for name, one in cameras.items()),
        in_part([one.above(CAPTURED) for one in cameras.values()]),
    )


def _end_to_end(found: Found) -> Claim:
    seen, lost = (share_of_passes(found, name) for name in (whole.WITH, whole.WITHOUT))
    delay = mean_error(found.figures[whole.WITH]["delay"])
    return Claim(
        "(Not in the paper) With roles: prediction decides whether the target is in the picture",
        f"from A to C at 30 mph, from {NEAR}, in at least {END_SEEN.low:.0%} of the passes with prediction, in at most "
        f"{END_LOST.high:.0%} without",
        f"with {with_interval(seen, percent)}, without {with_interval(lost, percent)}; control has the fix "
        f"{with_interval(delay)} s after the last CPA",
        verdict(all_of((END_SEEN.holds(seen), END_LOST.holds(lost)))),
    )


def _fast(found: Found) -> Claim:
    names = (whole.FASTER, whole.FASTER_ACROSS)
    return Claim(
        "(Not in the paper) With roles: so it does at 30 m/s",
        f"in at least {END_FAST.low:.0%} of the passes from A to C, from {NEAR}, if the camera looks at the field at "
        "pan 0, and if it looks north; in part: with one of them",
        "; ".join(f"{whole.view_of(name)} {_share(found, name)}" for name in names),
        in_part([END_FAST.holds(share_of_passes(found, name)) for name in names]),
    )


def _hops(found: Found) -> Claim:
    shares = {name: share_of_passes(found, name) for name in (whole.HOPS, whole.TWICE)}
    delays = ", ".join(with_interval(mean_error(found.figures[name]["delay"])) for name in shares)
    return Claim(
        "With roles: three additional hops to the camera control node (sec. 5)",
        f"in at least {END_SEEN.low:.0%} of the passes from A to C, from {NEAR}, also if each hop takes twice as long",
        f"{' and '.join(_share(found, name) for name in shares)}; control has the fix {delays} s after the last CPA",
        verdict(all_of(END_SEEN.holds(one) for one in shares.values())),
    )


_WHOLE: Final = (_captured, _end_to_end, _fast, _hops)
