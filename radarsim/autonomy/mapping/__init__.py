"""Maps from scans, and where the robot is on them: no sockets, no clock, no scene."""
