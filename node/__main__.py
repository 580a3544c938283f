"""``python -m node``: one sensor node, or with ``slave`` one slave, that joins a run through a router."""

from __future__ import annotations

from trackfield.drivers.standalone import main

main("node", {"node": "node.role:Node", "slave": "node.slave:Slave"}, __doc__)
