"""A person at the keyboard drives a robot over TCP, and sees its scan in the terminal.

What a key means, what is drawn and what is written beside it are functions without a
terminal; ``screen`` and ``driver`` are the shell around them. Like any client, this one
knows what comes over the wire and nothing else.
"""
