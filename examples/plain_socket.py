"""Talk to a server over a socket, without radarsim's client: for any language.

radarsim serve foliage_room
python examples/plain_socket.py [PORT]
"""

import socket
import sys

port = int(sys.argv[1]) if len(sys.argv) > 1 else 3000
with socket.create_connection(("127.0.0.1", port), timeout=120) as connection:
    lines = connection.makefile("rw", encoding="ascii", newline="\r\n")
    print(lines.readline().strip())  # the greeting, with the name of the level
    lines.write("INIT {ClassName USARBot.P3AT} {Start RobotStart1}\r\n")
    lines.write("DRIVE {Left 3} {Right 3}\r\n")  # wheel speeds, rad/s
    lines.flush()
    for line in lines:
        if "{Type RangeScanner}" in line:
            ranges = line.split("{Range ")[1].split("}")[0].split(",")
            print(f"{len(ranges)} ranges, the nearest {min(map(float, ranges))} m")
            break
