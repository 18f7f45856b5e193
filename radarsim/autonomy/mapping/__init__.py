"""SLAM and maps from scans: computation only, without sockets, clocks or a scene."""
