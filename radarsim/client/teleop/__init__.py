"""Teleoperation: drive a robot by keyboard over TCP, with its scan in the terminal.

The meaning of keys, the view and the panel are functions without a terminal;
``terminal`` and ``teleop`` are the shell around them. Like any client, this one knows
only what it receives from the server.
"""
