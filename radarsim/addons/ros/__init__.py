"""Bridges to ROS 2: topics of the robots of a server, live."""
