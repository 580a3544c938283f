"""Ctrl-C at an instant of emulated time, however fast the machine is."""

from __future__ import annotations

import os
import signal

import pytest

from launcher.record.ledger import Ledger
from trackfield.drivers.engine.frames import Frame


def interrupt_at(frames: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Have SIGINT come as soon as a virtual run has sent so many frames."""
    sent = Ledger.sent

    def watched(ledger: Ledger, frame: Frame, version: int | None = 0) -> None:
        sent(ledger, frame, version)
        if ledger.leaving.left == frames:
            os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(Ledger, "sent", watched)
