"""Simulated sensors: radars, lasers, INS, odometry and wheel sensors; no protocol."""
