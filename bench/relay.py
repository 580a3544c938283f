"""A port of this machine that passes all bytes on to a router, and counts them."""

from __future__ import annotations

import socket
import threading
from contextlib import suppress
from typing import Final

_MOST: Final = 1 << 16


class Relay:
    """Passes what comes at its ``port`` to the port ``to`` of this machine, and back: ``up`` and ``down`` bytes."""

    def __init__(self, to: int) -> None:
        self.up, self.down, self._to = 0, 0, to
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._listener.getsockname()[1])
        threading.Thread(target=self._accept, daemon=True).start()

    @property
    def bytes(self) -> int:
        """Both ways."""
        return self.up + self.down

    def close(self) -> None:
        """Take no more connections; those that there are go on."""
        self._listener.close()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                client, _ = self._listener.accept()
                try:
                    router = socket.create_connection(("127.0.0.1", self._to))
                except OSError:  # no router yet
                    client.close()
                    continue
                for source, sink, name in ((client, router, "up"), (router, client, "down")):
                    sink.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                    threading.Thread(target=self._pass, args=(source, sink, name), daemon=True).start()

    def _pass(self, source: socket.socket, sink: socket.socket, name: str) -> None:
        with suppress(OSError):
            while data := source.recv(_MOST):
                setattr(self, name, getattr(self, name) + len(data))  # one connection, one thread for each direction
                sink.sendall(data)
        with suppress(OSError):
            sink.shutdown(socket.SHUT_RDWR)


def free_port() -> int:
    """Where nobody listens yet."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
