from radarsim.rng import fixed_number, generator_for


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


def test_fixed_number_is_that_of_the_seed_whatever_is_drawn() -> None:
    drawn_from, fresh = generator_for(0, "a"), generator_for(0, "a")
    drawn_from.random(3)
    drawn_from.spawn(2)
    assert fixed_number(drawn_from) == fixed_number(fresh) < 2**64
    assert drawn_from.random() == fresh.random(4)[3]
    others = [generator_for(1, "a"), generator_for(0, "b"), *fresh.spawn(2)]
    assert len({fixed_number(each) for each in (fresh, *others)}) == 5
