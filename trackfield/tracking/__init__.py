"""What every process that tracks needs, whichever role it has: reports collected, tracks followed, beliefs kept."""
