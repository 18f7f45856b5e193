from radarsim.rng import generator_for


def numbers(*key: int | str) -> list[float]:
    seed, *names = key
    rng = generator_for(int(seed), *(str(name) for name in names))
    return [float(number) for number in rng.random(8)]


def test_same_seed_and_names_give_the_same_numbers() -> None:
    assert numbers(3, "R1", "lms200") == numbers(3, "R1", "lms200")


def test_other_seed_or_name_gives_other_numbers() -> None:
    keys = [(3, "R1", "lms200"), (4, "R1", "lms200"), (3, "R2", "lms200")]
    keys += [(3, "R1", "Hokuyo"), (3, "R1lms", "200")]
    assert len({tuple(numbers(*key)) for key in keys}) == len(keys)


def test_boundaries_of_names_matter() -> None:
    assert numbers(0, "ab", "c") != numbers(0, "a", "bc")
