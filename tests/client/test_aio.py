"""Concurrent use of ``AsyncClient``; test_clients.py tests what both clients share."""

import asyncio
import socket

import numpy as np
import pytest

from radarsim.addons.testing import UsarsimServer
from radarsim.client import AsyncClient, ClientError
from radarsim.client.clients import Connecting
from radarsim.protocol import reports

from .conftest import DEADLINE, Serve


def connected(server: UsarsimServer) -> Connecting[AsyncClient]:
    return AsyncClient.connect(port=server.port, timeout=DEADLINE)


@pytest.mark.usarsim(speed=5)
async def test_one_task_reads_while_another_drives(
    usarsim_server: UsarsimServer,
) -> None:
    async with AsyncClient(
        *await asyncio.open_connection(*usarsim_server.address), timeout=DEADLINE
    ) as c:
        await c.spawn("P3AT", start="RobotStart1")

        async def drive() -> None:
            for spin in (1.0, 2.0, 3.0):
                await c.drive(spin, spin)
                await asyncio.sleep(0.02)

        async def watch() -> float:
            while (place := (await c.wait_for(reports.Odometry)).pose.x) < 0.1:
                pass
            return place

        place, _ = await asyncio.gather(watch(), drive())
        assert place >= 0.1
        assert (await c.wait_for(reports.GroundTruth)).pose.x > -8
    with pytest.raises(
        ClientError, match=r"^the connection is closed; the client could not send 'DRI"
    ):
        await c.drive(1, 1)


@pytest.mark.usarsim(speed=5)
async def test_calls_at_once_get_each_what_they_wait_for(
    usarsim_server: UsarsimServer,
) -> None:
    async with connected(usarsim_server) as client:
        await client.spawn("P3AT", start="RobotStart1")

        async def times(kind: type[reports.SensorReport]) -> list[float]:
            return [(await client.wait_for(kind)).time for _ in range(10)]

        async def change(value: float) -> None:
            if value > 0:
                await client.change_settings("lms200", max_range=value)
                return
            with pytest.raises(ClientError, match=f"max_range: {value:g}, expected"):
                await client.change_settings("lms200", max_range=value)

        series = await asyncio.gather(
            *map(times, (reports.RangeScan, reports.RangeScan, reports.Odometry))
        )
        _, geometry, configuration, _ = await asyncio.gather(
            times(reports.RangeScan),
            client.geometry("RangeScanner"),
            client.configuration("RangeScanner"),
            asyncio.gather(*map(change, (-1, 3, -2, 4, -3))),
        )
    assert isinstance(geometry, reports.ItemGeo)
    assert isinstance(configuration, reports.ScannerConf)
    for each in series:  # a busy machine drops some of them, and repeats none
        periods = np.diff(each) / 0.1
        assert periods.min() > 0.8
        assert periods == pytest.approx(np.round(periods), abs=0.11)


@pytest.mark.usarsim(speed=5)
async def test_wait_goes_on_when_the_task_that_reads_is_cancelled(
    usarsim_server: UsarsimServer,
) -> None:
    async with connected(usarsim_server) as client:
        await client.greeting()
        reading = asyncio.ensure_future(client.wait_for(reports.RobotLeft))
        waiting = asyncio.ensure_future(client.wait_for(reports.StartPoses))
        await asyncio.sleep(0)
        reading.cancel()
        await asyncio.wait([reading])
        await client.send(b"GETSTARTPOSES\r\n")
        assert (await waiting).poses


async def test_all_who_wait_for_a_report_get_it(usarsim_server: UsarsimServer) -> None:
    async with connected(usarsim_server) as client:
        waiting = [
            asyncio.ensure_future(client.wait_for(reports.Greeting)) for _ in range(3)
        ]
        first, *others = await asyncio.gather(*waiting)
        assert first == reports.Greeting("DM-EmptyRoom")
        assert others == [first, first]


@pytest.mark.usarsim(speed=5)
async def test_cancelled_read_loses_no_report(usarsim_server: UsarsimServer) -> None:
    async with connected(usarsim_server) as client:
        await client.spawn("P3AT", start="RobotStart1")
        await client.wait_for(reports.RangeScan)
        times: list[float] = []
        while len(times) < 10:
            try:
                async with asyncio.timeout(0.003):
                    times.append((await client.wait_for(reports.RangeScan)).time)
            except TimeoutError:
                pass
        assert times == sorted(times)
        assert client.session.unread == 0


@pytest.mark.usarsim(speed=5)
async def test_loop_over_a_client_ends_when_it_is_closed(
    usarsim_server: UsarsimServer,
) -> None:
    async with connected(usarsim_server) as client:
        await client.spawn("P3AT", start="RobotStart1")
        scans = []
        async for report in client:
            if isinstance(report, reports.RangeScan):
                assert client.newest(reports.RangeScan) is not None
                scans.append(report.time)
            if len(scans) == 5:
                await client.close()
        with pytest.raises(ClientError, match="the connection is closed"):
            await client.drive(0.0, 0.0)
    assert np.diff(scans) == pytest.approx(0.1, abs=0.011)


async def test_client_is_closed_at_the_end_of_its_block(
    usarsim_server: UsarsimServer,
) -> None:
    async with connected(usarsim_server) as client:

        async def collect() -> list[reports.Report]:
            return [report async for report in client]

        collecting = asyncio.ensure_future(collect())
        greeting = await client.greeting()
    assert await collecting == [greeting]
    with pytest.raises(ClientError, match="the connection is closed"):
        await client.start_poses()


async def test_answer_of_a_cancelled_change_is_not_that_of_the_next_one(
    usarsim_server: UsarsimServer,
) -> None:
    async with connected(usarsim_server) as client:
        await client.spawn("P3AT", start="RobotStart1")
        refused = asyncio.ensure_future(client.change_settings(max_range=-1))
        await asyncio.sleep(0)  # until it is sent
        refused.cancel()
        await client.change_settings(max_range=7)
        with pytest.raises(ClientError, match="max_range: -2, expected"):
            await client.change_settings(max_range=-2)


async def test_close_does_not_wait_for_a_server_that_does_not_read(
    serve: Serve,
) -> None:
    def stall(peer: socket.socket) -> None:
        while peer.send(b"\r\n" * 10_000):  # until the client has gone
            pass

    async def flood(client: AsyncClient) -> None:
        for _ in range(100):
            await client.set_item("A", None, "B", "x" * 500_000)

    streams = await asyncio.open_connection("127.0.0.1", serve(stall))
    async with AsyncClient(*streams, timeout=0.05) as client:
        with pytest.raises(ClientError, match=r"^the server has stopped reading; the"):
            await flood(client)
        assert not await client.stop()
