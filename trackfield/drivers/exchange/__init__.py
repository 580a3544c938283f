"""What a process exchanges with others over Zenoh: frames and their versions, telemetry, seals."""
