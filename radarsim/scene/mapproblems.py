"""What is found wrong with a map file, while it is read to its end."""

from collections.abc import Iterable
from typing import Any, TypeVar

from pydantic import ValidationError

from radarsim.scene.mapchecks import Problem
from radarsim.scene.mapmodel import Entry
from radarsim.yamlfile import YamlFile, shown
from radarsim.yamlnodes import KeyPath

_AnyEntry = TypeVar("_AnyEntry", bound=Entry)


class MapProblems:
    """Looks at entries of a map file and collects what is wrong with them.

    Attributes:
        found: One text for each problem, with its place; what is wrong with the file
            as YAML comes first.
    """

    def __init__(self, file: YamlFile) -> None:
        self.found = list(file.problems)
        self._file = file

    def entry(
        self,
        model: type[_AnyEntry],
        item: Any,
        at: KeyPath,
        context: dict[str, Any] | None = None,
    ) -> _AnyEntry | None:
        """Look at an entry by itself; None if it is wrong."""
        try:
            return model.model_validate(item, context=context)
        except ValidationError as error:
            known = model.model_fields
            self.found += self._file.refusals(error, at, known=known)
            return None

    def take(
        self,
        at: KeyPath,
        names: Iterable[str],
        taken: dict[str, KeyPath],
        *,
        fold: bool = False,
    ) -> None:
        """Note that an entry has these names, or say which other entry has one.

        Args:
            at: Where the entry stands.
            names: Those of all its copies.
            taken: The names so far, with the places of their entries.
            fold: Whether names that differ in case alone are the same.
        """
        for name in names:
            other = taken.setdefault(name.casefold() if fold else name, at)
            if other != at:
                there = ".".join(str(key) for key in other)
                text = f"{shown(name)}, expected a name that {there} has not"
                self.report(at, [(("name",), text)])
                return

    def report(self, at: KeyPath, problems: Iterable[Problem]) -> bool:
        """Collect problems of an entry; tells whether there are none."""
        found = [self._file.problem((*at, *keys), text) for keys, text in problems]
        self.found += found
        return not found
