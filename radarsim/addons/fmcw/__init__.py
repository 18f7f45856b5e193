"""Rotating FMCW radars: from rays through a scene to the power in each range bin."""
