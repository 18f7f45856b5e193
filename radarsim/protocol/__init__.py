"""The text protocol of USARSim, without sockets: bytes to commands, reports to bytes.

Everything outside this package is REP-103; the axes of the wire exist only in here.
"""
