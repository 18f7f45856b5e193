import resource
import sys
from collections.abc import Iterator

import pytest

from radarsim.listening import raise_file_limit


@pytest.fixture(autouse=True)
def _limits_are_restored() -> Iterator[None]:
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    yield
    resource.setrlimit(resource.RLIMIT_NOFILE, before)


def set_limits(limit: int) -> int:
    """Set a limit, and return the number up to which it can be raised."""
    ceiling = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, (limit, ceiling))
    return ceiling


def limit() -> int:
    return resource.getrlimit(resource.RLIMIT_NOFILE)[0]


@pytest.mark.parametrize(("needed", "after"), [(600, 600), (400, 500)])
def test_limit_is_raised_to_what_is_needed_and_not_lowered(
    needed: int, after: int
) -> None:
    set_limits(500)
    assert raise_file_limit(needed) == needed
    assert limit() == after


def test_what_the_system_does_not_permit_is_not_asked_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    set_limits(500)
    monkeypatch.setattr(resource, "getrlimit", lambda _: (500, 550))
    asked = []
    monkeypatch.setattr(resource, "setrlimit", lambda *limits: asked.append(limits))
    assert raise_file_limit(600) == 550
    assert asked == [(resource.RLIMIT_NOFILE, (550, 550))]


@pytest.mark.parametrize("limits", [(-1, -1), (500, -1)])
def test_limit_can_be_infinite(
    monkeypatch: pytest.MonkeyPatch, limits: tuple[int, int]
) -> None:
    assert resource.RLIM_INFINITY == -1
    monkeypatch.setattr(resource, "getrlimit", lambda _: limits)
    monkeypatch.setattr(resource, "setrlimit", lambda *_: None)
    assert raise_file_limit(600) == 600


def test_refusal_of_the_system_leaves_the_limit_as_it_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def refuse(*_: object) -> None:
        raise ValueError("not allowed")

    set_limits(500)
    monkeypatch.setattr(resource, "setrlimit", refuse)
    assert raise_file_limit(600) == 500


def test_system_without_such_a_limit_permits_all(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "resource", None)
    assert raise_file_limit(600) == 600
