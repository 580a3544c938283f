"""What points a camera at fixed targets: camera control, the camera as a device, and the capture of its video."""
