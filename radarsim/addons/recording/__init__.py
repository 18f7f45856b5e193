"""Recordings of runs: ROS 2 bags with the wire, and how to read and repeat them."""
