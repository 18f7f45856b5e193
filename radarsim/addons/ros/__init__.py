"""Bridges to ROS 2, which publish the robots of a running server as topics."""
