"""``router``."""

from __future__ import annotations

from typing import Annotated

import typer


def router(
    listen: Annotated[
        list[str], typer.Option(metavar="ENDPOINT", help="Where to listen, like tcp/0.0.0.0:7447; may be repeated.")
    ],
) -> None:
    """Run a Zenoh router for runs whose processes start elsewhere, until Ctrl-C."""
    from launcher.options import check_endpoint
    from launcher.processes.endpoint import serve

    for endpoint in listen:
        check_endpoint(endpoint, "--listen")
    serve(listen)
