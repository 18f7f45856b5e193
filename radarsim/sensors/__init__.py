"""Sensors: a pose, a scene and a generator give readings; no protocol, no clock."""
