"""Old names of the client still work, and say which name replaces them."""

import asyncio

import pytest

import radarsim.client
from radarsim.client import AsyncClient, Client, SocketTransport
from radarsim.protocol.reports import Odometry
from radarsim.pytest_plugin import UsarsimServer

DEADLINE = 30.0  # s of the wall clock, for a busy machine


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("Link", "Transport"),
        ("RobotFacts", "RobotInfo"),
        ("ScannerFacts", "ScannerInfo"),
        ("SocketLink", "SocketTransport"),
    ],
)
def test_old_class_names_can_be_imported(old: str, new: str) -> None:
    with pytest.warns(DeprecationWarning, match=rf"\.{old} .* use .*\.{new}$"):
        assert getattr(radarsim.client, old) is getattr(radarsim.client, new)


def test_unknown_names_are_attribute_errors() -> None:
    with pytest.raises(AttributeError, match="no attribute 'Linker'"):
        radarsim.client.Linker  # noqa: B018 - looking is the test


def test_old_members_of_the_blocking_client_work(usarsim_server: UsarsimServer) -> None:
    with Client.connect(port=usarsim_server.port, timeout=DEADLINE) as client:
        client.spawn("P3AT")
        with pytest.warns(DeprecationWarning, match=r"use Client\.transport$"):
            assert client.link is client.transport
        with pytest.warns(DeprecationWarning, match=r"use Client\.robot_info$"):
            assert client.facts() == client.robot_info()
        with pytest.warns(DeprecationWarning, match=r"use Client\.set_item$"):
            client.order("Odometry", None, "RESET")
        assert client.wait_for(Odometry).pose.x == 0


def test_old_argument_of_the_blocking_client_works(
    usarsim_server: UsarsimServer,
) -> None:
    transport = SocketTransport(*usarsim_server.address)
    with pytest.warns(DeprecationWarning, match=r"use Client\(transport=\.\.\.\)$"):
        client = Client(link=transport)
    assert client.transport is transport
    client.close()
    with pytest.raises(TypeError, match="without a transport, expected one"):
        Client()


async def test_old_methods_of_the_asynchronous_client_work(
    usarsim_server: UsarsimServer,
) -> None:
    streams = await asyncio.open_connection(*usarsim_server.address)
    async with AsyncClient(*streams, timeout=DEADLINE) as client:
        await client.spawn("P3AT")
        with pytest.warns(DeprecationWarning, match=r"use AsyncClient\.robot_info$"):
            info = await client.facts()
        assert info == await client.robot_info()
        with pytest.warns(DeprecationWarning, match=r"use AsyncClient\.set_item$"):
            await client.order("Odometry", None, "RESET")
        assert (await client.wait_for(Odometry)).pose.x == 0
