"""``python -m gateway``: a gateway at the base of a field, or with ``forwarder`` or ``system`` one of these.

It joins a run through a router.
"""

from __future__ import annotations

from collections.abc import Mapping

from trackfield.drivers.standalone import main

GATEWAY = {"sink": "fusion.sink:Sink", "gateway": "gateway.gateway:Gateway"}
ROLES: Mapping[str, str | Mapping[str, str]] = {
    "gateway": GATEWAY,
    "forwarder": "gateway.forwarder:Forwarder",
    "system": "gateway.system:System",
}

main("gateway", ROLES, __doc__, installed=True)
