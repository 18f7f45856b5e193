"""Usage errors in the words of the program's other messages, not of the framework."""

import re
from typing import Any

import typer
from typer.core import TyperGroup

from radarsim.suggestions import expected_one_of


class PlainGroup(TyperGroup):
    """A group of commands that words errors of usage as the rest of the program."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command; its values are converted here as well."""
        try:
            return super().invoke(ctx)
        except typer.BadParameter as error:
            error.message = _reworded(error)
            raise


def _reworded(error: typer.BadParameter) -> str:
    from pydantic import ValidationError

    from radarsim.validation import describe_invalid

    text = error.message
    if isinstance(error.__cause__, ValidationError):  # typer validates with pydantic
        text = describe_invalid(error.__cause__.errors()[0])
    choice = re.fullmatch(r"'(.*)' is not one of ('.*')\.?", text)
    if choice is None:
        return text
    return expected_one_of(choice[1], re.findall("'(.*?)'", choice[2]))
