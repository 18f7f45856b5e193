"""How much of what clients send is read in a tick."""

from radarsim.server.peer_connections import (
    BURST,
    REFILL,
    TURNS,
    ReadAllowance,
    ReadTurns,
)


def advance(turns: ReadTurns, ticks: int) -> None:
    for _ in range(ticks):
        turns.advance()


def test_client_that_sends_little_never_waits() -> None:
    turns = ReadTurns()
    flooding = [ReadAllowance(turns) for _ in range(100)]
    modest = ReadAllowance(turns)
    for _ in range(200):
        for allowance in flooding:
            if not allowance.exhausted:
                allowance.spend(2048)
        modest.spend(REFILL // 2)
        assert not modest.exhausted
        turns.advance()


def test_allowance_is_refilled_up_to_a_burst() -> None:
    turns = ReadTurns()
    allowance = ReadAllowance(turns)
    for _ in range(3):
        advance(turns, 2 * BURST // REFILL)
        allowance.spend(BURST // 2)
        assert not allowance.exhausted
    allowance.spend(BURST)
    assert allowance.exhausted


def test_clients_that_send_a_lot_are_read_in_turns() -> None:
    turns = ReadTurns()
    flooding = [ReadAllowance(turns) for _ in range(3 * TURNS)]
    reads = [0] * len(flooding)
    for _ in range(90):
        for index, allowance in enumerate(flooding):
            if not allowance.exhausted:
                allowance.spend(2048)
                reads[index] += 1
        turns.advance()
    assert max(reads) - min(reads) <= 1
    assert 80 <= sum(reads) / TURNS <= 100


def test_closed_connection_takes_no_turn() -> None:
    turns = ReadTurns()
    flooding = [ReadAllowance(turns) for _ in range(5 * TURNS)]
    for allowance in flooding:
        allowance.spend(2 * BURST)
        allowance.closed = allowance is not flooding[-1]
    turns.advance()
    assert not flooding[-1].exhausted


def test_client_that_becomes_quiet_gets_its_allowance_back() -> None:
    turns = ReadTurns()
    allowance = ReadAllowance(turns)
    allowance.spend(2 * BURST)
    advance(turns, 2 * BURST // REFILL)
    allowance.spend(BURST // 2)
    assert not allowance.exhausted
