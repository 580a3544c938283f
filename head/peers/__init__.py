"""Any node may lead: the half of a node's process that tracks while its turn lasts (docs/peers.md)."""
