"""Connects to a server like a client in the field, and gets one scan of a P3AT."""

import socket
import sys

host, _, port = sys.argv[1].rpartition(":")
# A busy machine may take a while.
with socket.create_connection((host, int(port)), 600) as client:
    lines = client.makefile("rb")
    greeting = lines.readline()
    assert greeting.startswith(b"NFO {Gametype "), greeting
    assert b"{Level DM-FoliageRoom}" in greeting, greeting
    client.sendall(b"INIT {ClassName USARBot.P3AT} {Start RobotStart1}\r\n")
    for line in lines:
        if line.startswith(b"SEN") and b"{Type RangeScanner}" in line:
            break
    else:
        sys.exit("the server has closed the connection")
    values = line.partition(b"{Range ")[2].partition(b"}")[0].split(b",")
    assert len(values) == 181, line
    assert all(0 < float(value) <= 80 for value in values), line
    sys.stdout.write(f"{len(values)} ranges, {line[:80].decode()}...\n")
