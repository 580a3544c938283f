"""What is beyond the gateway of a field: forwarding nodes, camera control, a camera, video, system control."""

from launcher.plan.architectures.outside.arranged import Outside, outside_of

__all__ = ["Outside", "outside_of"]
