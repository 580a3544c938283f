"""Runs a program that was linked with ``stand_in.c`` in the place of zenoh-pico, with a session of its own."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from threading import Lock, Thread
from typing import Any

import zenoh
from zenoh.handlers import Callback

from trackfield.drivers.session import open_client


class Bridged:
    """The program as a subprocess; ``said`` is what it says on stderr once it has ended."""

    def __init__(self, command: Sequence[str | Path], endpoint: str) -> None:
        self._session, self._lock, self._held = open_client(endpoint), Lock(), list[Any]()
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, text=True)
        Thread(target=self._serve, daemon=True).start()

    def ended(self, timeout: float) -> tuple[int, str]:
        """The exit code of the program, and what it said on stderr."""
        try:
            code = self.process.wait(timeout)
        finally:
            self.process.kill()
            self._session.close()  # type: ignore[no-untyped-call]
        assert self.process.stderr is not None
        return code, self.process.stderr.read()

    def _serve(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            word, key, *more = line.split()
            with suppress(zenoh.ZError):  # the session was closed
                self._do(word, key, more)

    def _do(self, word: str, key: str, more: list[str]) -> None:
        data = [bytes.fromhex(digits[1:]) for digits in more if digits.startswith(".")]
        if word == "put":
            self._session.put(key, data[0], attachment=data[1])
        elif word == "token":
            self._held.append(self._session.liveliness().declare_token(key))
        elif word == "subscribe":
            came = Callback(lambda sample: self._came(more[-1], sample), indirect=False)
            self._held.append(self._session.declare_subscriber(key, came))
        elif word == "get":
            replied = Callback(
                lambda reply: self._came(more[-1], reply.ok) if reply.ok else None,
                lambda: self._send(f"over {more[-1]}"),
                indirect=False,
            )
            self._session.get(key, replied, payload=data[0], attachment=data[1] or None)

    def _came(self, number: str, sample: zenoh.Sample) -> None:
        attachment = sample.attachment.to_bytes() if sample.attachment else b""
        self._send(f"came {number} {sample.key_expr} .{sample.payload.to_bytes().hex()} .{attachment.hex()}")

    def _send(self, line: str) -> None:
        assert self.process.stdin is not None
        with self._lock, suppress(OSError, ValueError):  # the program has ended
            self.process.stdin.write(f"{line}\n")
            self.process.stdin.flush()
