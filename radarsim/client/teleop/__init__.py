"""Teleoperation: drive a robot by keyboard over TCP, with its scan in the terminal.

What a driver sees (``view``) is drawn without a terminal; ``teleop`` is the shell
around it. Like any client, this one knows only what it receives from the server.
"""
