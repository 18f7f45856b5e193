"""The commands ``navigate``, ``map`` and ``trials``."""
