import pickle

from radarsim.errors import MapError


def test_the_problems_of_a_map_survive_pickling() -> None:
    error = pickle.loads(pickle.dumps(MapError(["a: bad", "b: worse"])))
    assert isinstance(error, MapError)
    assert error.problems == ["a: bad", "b: worse"]
    assert str(error) == "a: bad\nb: worse"
