"""Questions to USARTruth, and what answers them."""

import pytest

from radarsim.geometry import Pose3
from radarsim.protocol.dialect import COMPAT, UDK, Dialect
from radarsim.protocol.questions import END, answer_truth

ACTORS = (
    ("R1", "P3AT", Pose3(1.0, 2.0, 0.1)),
    ("R2", "Kenaf", Pose3(3.0, 4.0, 0.1)),
    ("Becky", "Victim", Pose3(-4.0, 0.5, 0.1)),
)


@pytest.mark.parametrize("dialect", [COMPAT, UDK], ids=lambda each: each.name)
@pytest.mark.parametrize(
    ("line", "names"),
    [
        ("", ["R1", "R2", "Becky"]),
        ("{Actors}", ["R1", "R2", "Becky"]),
        ("{Class USARBotAPI.USARVehicle}", ["R1", "R2"]),
        ("{Class Victim}", ["Becky"]),
        ("{Class USARBot.p3at}", ["R1"]),
        ("{Class Pawn} {Name R2}", ["R2"]),
        ("{Name R3}", []),
        ("{Name {R1}", []),
    ],
)
def test_fields_of_a_question_limit_the_answer(
    line: str, names: list[str], dialect: Dialect
) -> None:
    answer = answer_truth(line, ACTORS, 1.5, dialect)
    lines = answer.decode("ascii").splitlines()
    assert [each.split("}")[0] for each in lines[:-1]] == [f"{{Name {n}" for n in names]
    assert answer.endswith(END)
