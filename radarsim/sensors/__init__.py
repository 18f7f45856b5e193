"""Simulated sensors, such as radars, lasers, INS, GPS, sonars and wheel sensors."""
