"""What is sent for one pass of a target by five nodes: reports of passes, or audio, directions, levels (sec. 2)."""

from __future__ import annotations

from typing import Final, NamedTuple

from launcher.reproduce.papers.yang.solved.rivals import WINDOW_S
from trackfield.wire.codec import encode
from trackfield.wire.messages import Doa, Rss
from trackfield.wire.passes import CpaReport, CpaReportSds

NODES: Final = 5
RECORDED_S: Final = 5.0
"""The paper's recording of a pass (sec. 4.4)."""
AUDIO_HZ: Final = 4000
BYTES_PER_SAMPLE: Final = 2
TIME_BYTES: Final = 4
"""Of a time alone: two for the integer and two for the decimals (sec. 2)."""


class Sent(NamedTuple):
    """A way to locate a target: payload (bytes) of a message, messages of a node and pass; microphones of a node."""

    bytes: int
    messages: int
    microphones: int = 1

    @property
    def total(self) -> int:
        """Payload (bytes) of all nodes for a pass."""
        return NODES * self.bytes * self.messages


def sent() -> dict[str, Sent]:
    """Every way, by name. Messages have their largest size: fields with all digits that they can have."""
    steps = int(RECORDED_S / WINDOW_S)
    report = CpaReport(step=65535, early_s=6.5535, event=255, strength_db=199.99, width_s=6.35)
    sds = CpaReportSds(65535, 6.5535, 255, 199.99, 6.35, 6.5535, 99.99)
    samples = int(AUDIO_HZ * BYTES_PER_SAMPLE * RECORDED_S)
    return {
        "the paper's time": Sent(TIME_BYTES, 1),
        "CPA report": Sent(len(encode(report)), 1),
        "CPA report, with sds": Sent(len(encode(sds)), 1),
        "DOA, a bearing each 0.5 s": Sent(len(encode(Doa(65535, 359.99, 199.99))), steps, microphones=4),
        "EKF, a level each 0.5 s": Sent(len(encode(Rss(65535, -99.99))), steps),
        "TDOA, audio of 0.5 s": Sent(int(samples * WINDOW_S / RECORDED_S), 1),
        "TDOA, audio of 5 s": Sent(samples, 1),
    }
