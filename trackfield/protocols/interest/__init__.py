"""Directed diffusion: interests spread from who wants data, and data finds its way there (``piece``)."""
