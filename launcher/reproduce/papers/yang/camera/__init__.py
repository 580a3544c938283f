"""The camera of Yang et al.: whether the target is in its picture, with and without prediction."""
