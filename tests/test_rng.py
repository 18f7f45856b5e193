from radarsim.rng import generator_for


def numbers(*key: int | str) -> list[float]:
    seed, *names = key
    rng = generator_for(int(seed), *(str(name) for name in names))
    return [float(number) for number in rng.random(8)]


def test_the_same_key_draws_the_same() -> None:
    assert numbers(3, "R1", "lms200") == numbers(3, "R1", "lms200")


def test_another_seed_or_name_draws_other_numbers() -> None:
    keys = [(3, "R1", "lms200"), (4, "R1", "lms200"), (3, "R2", "lms200")]
    keys += [(3, "R1", "Hokuyo"), (3, "R1lms", "200")]
    assert len({tuple(numbers(*key)) for key in keys}) == len(keys)


def test_where_names_are_cut_matters() -> None:
    assert numbers(0, "ab", "c") != numbers(0, "a", "bc")
