"""The study of what a radar is good for: the same tasks for radars and lasers."""
