"""The problems of a map file, of which the first are told and all are counted."""

from collections.abc import Iterable
from typing import Final

from pydantic import ValidationError

from radarsim.errors import MapError
from radarsim.scene.map_checks import Problem
from radarsim.yaml_reader import KeyPath, YamlFile

MAX_TOLD: Final = 100


class ProblemList:
    """Collects the problems of a map file; those of the file as YAML come first.

    Problems of several variants are told once.

    Attributes:
        found: How many have been found.
    """

    def __init__(self, file: YamlFile) -> None:
        self.found = 0
        self._file = file
        self._told: dict[str, None] = {}
        self._reported: set[Problem] = set()  # those of entries that are told
        self._untold = 0
        self._add(file.problems)

    @property
    def full(self) -> bool:
        """Whether further problems are only counted; nothing need be built then."""
        return len(self._told) >= MAX_TOLD

    def report(self, at: KeyPath, problems: Iterable[Problem]) -> bool:
        """Add problems of an entry at a key path; return whether there are none."""
        before = self.found
        for keys, text in problems:
            problem = (*at, *keys), text
            if problem in self._reported:
                self.found += 1
            elif self.full:
                self._count(1)
            else:
                self._reported.add(problem)
                self._add([self._file.problem(*problem)])
        return self.found == before

    def report_invalid(
        self, error: ValidationError, at: KeyPath, known: Iterable[str]
    ) -> None:
        """Add what pydantic has found in an entry; ``known`` are the entry's keys."""
        most = 0 if self.full else MAX_TOLD
        if most:
            self._add(self._file.validation_problems(error, at, known=known, most=most))
        self._count(max(error.error_count() - most, 0))

    def raise_all(self) -> None:
        """Raise what has been found.

        Raises:
            MapError: If there are any problems; if they are many, a last line says how
                many more there are.
        """
        if self._untold:
            more = f"{self._file.path}: {self._untold} more problems"
            raise MapError([*self._told, more])
        if self._told:
            raise MapError(list(self._told))

    def _count(self, number: int) -> None:
        """Count problems that are not told."""
        self.found += number
        self._untold += number

    def _add(self, problems: Iterable[str]) -> None:
        for problem in problems:
            if problem in self._told:
                self.found += 1
            elif self.full:
                self._count(1)
            else:
                self.found += 1
                self._told[problem] = None
