"""The text protocol of USARSim without sockets: parses and encodes its lines.

Commands and reports are values in SI units and REP-103 frames. The axes of the wire
exist only in this package.
"""
