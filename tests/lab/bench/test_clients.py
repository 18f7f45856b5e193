import socket

from radarsim.lab.bench.clients import listen, wait_for_robots

SCAN = b"SEN {Time 1.20} {Type RangeScanner} {Name lms200} {Range 1.00}\r\n"


def test_robots_are_there_once_their_clients_get_a_status() -> None:
    client, server = socket.socketpair()
    with client, server:
        server.sendall(b"NFO {Gametype x}\r\nSTA {Time 1.20}\r\n")
        wait_for_robots([client], 10.0)


def test_a_robot_that_does_not_come_is_not_waited_for_for_ever() -> None:
    client, server = socket.socketpair()
    with client, server:
        server.sendall(b"NFO {Gametype x}\r\n")
        wait_for_robots([client], 0.05)


def test_each_scan_has_a_delay() -> None:
    client, server = socket.socketpair()
    with client, server:
        server.sendall(SCAN * 3)
        delays = listen([client], 0.05)
    assert len(delays) == 3
