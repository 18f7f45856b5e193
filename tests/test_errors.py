import pickle

from radarsim.errors import MapError


def test_map_error_survives_pickling() -> None:
    error = pickle.loads(pickle.dumps(MapError(["a: bad", "b: worse"])))
    assert isinstance(error, MapError)
    assert error.problems == ["a: bad", "b: worse"]
    assert str(error) == "a: bad\nb: worse"
