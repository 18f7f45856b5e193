"""Calls into the engine, a library in C++, by ctypes.

The library knows neither Python nor numpy, so that one file serves all versions of
both. It describes its functions and structures itself, see ``door.hpp``. These
descriptions are read when it is opened, and each call is checked against them: the type
of each array, its order, its number of axes, and lengths that have to agree. What else
has to hold, functions check themselves, but for indices that this package has made.

Python's lock is released during calls.
"""

import ctypes
import enum
import functools
import operator
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NoReturn, TypeAlias

import numpy as np
from numpy.typing import NDArray

from radarsim.engine.build import FOLDER, LIBRARY, source_digest
from radarsim.errors import EngineError

_Bytes = ctypes.c_char * 0
# Behind the head of the object numpy has the address of its numbers, in all versions.
# To ask for it takes up to five times as long.
_HEAD: Final = object.__basicsize__
_pointer_at = ctypes.c_size_t.from_address
# The lengths that have a name: all arrays of a call that share the name share it.
_Lengths: TypeAlias = dict[str, int]


def address(array: NDArray[Any]) -> int:
    """Return the address of a contiguous array; it is valid as long as the array is."""
    return _pointer_at(id(array) + _HEAD).value


class _Number:
    """A number among the parameters of a function or the fields of a structure."""

    def __init__(self, code: str) -> None:
        self.form, self.format = None, "d" if code == "f8" else "q"
        # ``float`` would also read text.
        as_float = operator.methodcaller("__float__")
        self._convert: Any = as_float if code == "f8" else operator.index

    def add(self, words: list[Any], value: Any, name: str, _lengths: _Lengths) -> None:
        try:
            number = self._convert(value)
            struct.pack(self.format, number)  # it may have too many digits
        except (AttributeError, TypeError, struct.error) as error:
            raise EngineError(f"{name} is {value!r}, expected a number") from error
        words.append(number)


class _Row:
    """Some numbers within a structure."""

    def __init__(self, code: str) -> None:
        kind, _, count = code.removesuffix("]").partition("[")
        self.format = count + ("d" if kind == "f8" else "q")
        self._count = int(count)

    def add(self, words: list[Any], value: Any, name: str, _lengths: _Lengths) -> None:
        try:
            struct.pack(self.format, *value)
        except (TypeError, struct.error) as error:
            text = f"{name} is {value!r}, expected {self._count} numbers"
            raise EngineError(text) from error
        words.extend(value)


class _Array:
    """An array among the parameters of a function or the fields of a structure."""

    def __init__(self, code: str, structures: "dict[str, Structure]") -> None:
        self._is_written = code.startswith("=")
        kind, _, axes = code[1:].removesuffix("]").partition("[")
        leading, _, row = axes.partition(";")  # of rows the lengths are known in C++
        names = leading.split(",") + (row.split(",") if row else [])
        self._axes = [int(name) if name.isdigit() else name for name in names]
        self._dtype = structures[kind].dtype if kind in structures else np.dtype(kind)
        self._leading = leading.count(",") + 1
        self.format = "Q" + "q" * self._leading
        axes = ",".join(names)
        self._text = f"an array {kind}[{axes}]" + " to write to" * self._is_written
        self.lengths, rows = self._axes[: self._leading], self._axes[self._leading :]
        self.form = self._dtype, self._leading, tuple(rows)

    def add(self, words: list[Any], value: Any, name: str, lengths: _Lengths) -> None:
        if not isinstance(value, np.ndarray):
            raise self._unexpected(value, name, lengths)
        flags, shape, dtype = value.flags, value.shape, value.dtype
        if dtype is not self._dtype and dtype != self._dtype:
            raise self._unexpected(value, name, lengths)
        is_usable = (
            flags.c_contiguous and flags.aligned and len(shape) == len(self._axes)
        )
        if not is_usable or (self._is_written and not flags.writeable):
            raise self._unexpected(value, name, lengths)
        for axis, length in zip(self._axes, shape, strict=True):
            known = lengths.setdefault(axis, length) if isinstance(axis, str) else axis
            if known != length:
                raise self._unexpected(value, name, lengths)
        words.append(address(value))
        words.extend(shape[: self._leading])

    def _unexpected(self, value: Any, name: str, lengths: _Lengths) -> EngineError:
        came = repr(value)
        if isinstance(value, np.ndarray):
            came = f"an array {value.dtype}{list(value.shape)}"
            came += "" if value.flags.c_contiguous else ", not contiguous"
            came += "" if value.flags.writeable else ", read-only"
        known = ", ".join(f"{a} = {lengths[a]}" for a in self._axes if a in lengths)
        where = f" where {known}" if known else ""
        return EngineError(f"{name} is {came}, expected {self._text}{where}")


class _Reference:
    """A packed structure among parameters or fields."""

    format = "Q"

    def __init__(self, code: str) -> None:
        self._name = self.form = code.removeprefix("&")

    def add(self, words: list[Any], value: Any, name: str, _lengths: _Lengths) -> None:
        if not isinstance(value, Packed) or value.structure.name != self._name:
            raise EngineError(f"{name} is {value!r}, expected a packed {self._name}")
        words.append(value.address)


_Parameter: TypeAlias = _Number | _Row | _Array | _Reference


def _parameter(code: str, structures: "dict[str, Structure]") -> _Parameter:
    match code[0]:
        case "*" | "=":
            return _Array(code, structures)
        case "&":
            return _Reference(code)
        case _:
            return _Row(code) if code.endswith("]") else _Number(code)


class Packed:
    """A structure in memory, with the arrays and structures that it refers to.

    Its fields are attributes of their names.

    Attributes:
        structure: Its type.
        fields: The value of each field.
        address: Where it is.
    """

    def __init__(
        self, structure: "Structure", memory: bytearray, fields: dict[str, Any]
    ) -> None:
        self.structure = structure
        self.fields = fields
        self._memory = memory
        self.address = ctypes.addressof(_Bytes.from_buffer(memory))

    def __repr__(self) -> str:
        return f"a packed {self.structure.name}"

    def __reduce__(self) -> NoReturn:
        raise TypeError(f"{self!r} refers to memory of this process")

    def __getattr__(self, name: str) -> Any:
        try:
            return self.fields[name]
        except KeyError:
            raise AttributeError(f"{self.structure.name} has no {name!r}") from None


class Structure:
    """A structure of the engine: a row of an array, or what functions take packed.

    Attributes:
        name: Its name in C++.
    """

    def __init__(self, name: str, size: int, fields: Sequence[str]) -> None:
        """Read a description.

        Args:
            name: Its name in C++.
            size: bytes.
            fields: Of each field its name, its offset in bytes, and its code.
        """
        self.name, self._size = name, size
        self._names, self._codes = fields[::3], fields[2::3]
        self._offsets = [int(offset) for offset in fields[1::3]]

    @functools.cached_property
    def dtype(self) -> np.dtype[np.void]:
        """The type of a row of an array."""
        fields = zip(self._names, self._codes, self._offsets, strict=True)
        types = {name: (_field_type(code), offset) for name, code, offset in fields}
        names, formats = list(types), [kind for kind, _ in types.values()]
        return np.dtype(
            {
                "names": names,
                "formats": formats,
                "offsets": self._offsets,
                "itemsize": self._size,
            }
        )

    def pack(self, **values: Any) -> Packed:
        """Pack a structure; its arrays are not copied.

        Args:
            values: A value for each field.

        Raises:
            EngineError: If a value is not as the description says, or a field has none.
        """
        if unknown := values.keys() ^ set(self._names):
            raise EngineError(f"{self.name}: {sorted(unknown)} are missing or unknown")
        memory, lengths = bytearray(self._size), dict[str, int]()
        fields = zip(self._names, self._parameters, self._offsets, strict=True)
        for name, parameter, offset in fields:
            words: list[Any] = []
            parameter.add(words, values[name], f"{self.name}.{name}", lengths)
            struct.pack_into(parameter.format, memory, offset, *words)
        return Packed(self, memory, values)

    @functools.cached_property
    def _parameters(self) -> list[_Parameter]:
        return [_parameter(code, engine.structures) for code in self._codes]


def _field_type(code: str) -> Any:
    kind, _, count = code.removesuffix("]").partition("[")
    return (kind, (int(count),)) if count else kind


class Function:
    """A function of the engine."""

    def __init__(self, name: str, start: int, codes: Sequence[str]) -> None:
        """Read a description.

        Args:
            name: Its name in C++.
            start: Its address.
            codes: The codes of its parameters, an arrow, and the code of its result.
        """
        self._name, self._codes = name, codes[:-2]
        has_none = codes[-1] == "none"
        result = None if has_none else np.ctypeslib.as_ctypes_type(np.dtype(codes[-1]))
        self._call = ctypes.CFUNCTYPE(result, ctypes.c_char_p)(start)
        self._may_refuse = codes[-1] == "?"

    def __call__(self, *arguments: Any) -> Any:
        """Call the function.

        Args:
            arguments: In the order of its parameters.

        Raises:
            EngineError: If one is not as the description says, or the function finds
                that they do not belong together.
        """
        # Many calls are short. Their arguments are checked one by one, which takes
        # longer, only if something about them is wrong or unusual.
        try:
            block = self._pack(*self._words(arguments))
        except (AttributeError, TypeError, ValueError, struct.error):
            block = self._pack(*self._checked_words(arguments))
        result = self._call(block)
        if self._may_refuse and not result:
            text = "lengths or indices that do not belong together"
            raise EngineError(f"{self._name} was called with {text}")
        return result

    def _words(self, arguments: Sequence[Any]) -> list[Any]:
        words: list[Any] = []
        forms, alike, fixed = self._rules
        for form, value in zip(forms, arguments, strict=True):
            if form is None:  # a number, which is checked when it is packed
                words.append(value)
            elif type(form) is tuple:
                dtype, axes, rows = form
                # Contiguous, aligned, and to be written to.
                if type(value) is not np.ndarray or not value.flags.carray:
                    raise TypeError
                shape, is_same = value.shape, value.dtype is dtype
                if not is_same or len(shape) < axes or shape[axes:] != rows:
                    raise TypeError
                words.append(_pointer_at(id(value) + _HEAD).value)
                words += shape[:axes]
            elif value.structure.name == form:
                words.append(value.address)
            else:
                raise TypeError
        if any(words[place] != words[other] for place, other in alike):
            raise TypeError
        if any(words[place] != length for place, length in fixed):
            raise TypeError
        return words

    @functools.cached_property
    def _rules(self) -> tuple[list[Any], list[tuple[int, int]], list[tuple[int, int]]]:
        """Forms of arguments; places of lengths that agree; places of given lengths."""
        place, first = 0, dict[str | int, int]()
        alike, fixed = [], []
        for _, parameter in self._parameters:
            for at, axis in enumerate(getattr(parameter, "lengths", ()), place + 1):
                if isinstance(axis, int):
                    fixed.append((at, axis))
                elif axis in first:
                    alike.append((at, first[axis]))
                else:
                    first[axis] = at
            place += len(parameter.format)
        forms = [getattr(each, "form", None) for _, each in self._parameters]
        return forms, alike, fixed

    def _checked_words(self, arguments: Sequence[Any]) -> list[Any]:
        if len(arguments) != len(self._codes):
            raise TypeError(f"{len(arguments)} arguments for {self._name}{self._codes}")
        words, lengths = list[Any](), dict[str, int]()
        for (name, parameter), argument in zip(
            self._parameters, arguments, strict=True
        ):
            parameter.add(words, argument, name, lengths)
        return words

    @functools.cached_property
    def _parameters(self) -> list[tuple[str, _Parameter]]:
        return [
            (f"argument {i} of {self._name}", _parameter(code, engine.structures))
            for i, code in enumerate(self._codes, 1)
        ]

    @functools.cached_property
    def _pack(self) -> Any:
        return struct.Struct(
            "=" + "".join(each.format for _, each in self._parameters)
        ).pack


class Engine:
    """The library.

    Its functions are attributes of their names.

    Attributes:
        structures: Its structures, by their names in C++.
        enumerations: Its enumerations likewise.
    """

    def __init__(self, path: Path) -> None:
        """Open the library.

        Raises:
            EngineError: If it cannot be opened, or was compiled from another source.
        """
        try:
            library = ctypes.CDLL(str(path))
        except OSError as error:
            raise EngineError(
                f"cannot use {path}: {error}; it is compiled when radarsim is installed"
            ) from error
        for name in ("describe", "sources"):
            getattr(library, f"radarsim_{name}").restype = ctypes.c_char_p
        # Only a checkout has the sources.
        if (FOLDER / "engine.cpp").exists():
            built = library.radarsim_sources().decode()
            if built != source_digest():
                raise EngineError(
                    f"{path} is not that of its source; compile it again by"
                    " 'pip install -e .', or by 'python radarsim/engine/build.py'"
                    " where ziglang is installed"
                )
        self.structures: dict[str, Structure] = {}
        self.enumerations: dict[str, Any] = {}
        for line in library.radarsim_describe().decode().splitlines():
            name, number, kind, *codes = line.split()
            if kind == "structure":
                self.structures[name] = Structure(name, int(number), codes)
            elif kind == "enumeration":
                members = "".join(codes).split(",")
                self.enumerations[name] = enum.IntEnum(name, members, start=0)
            else:
                setattr(self, name, Function(name, int(number), codes))

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(f"the engine has no function {name!r}")


engine: Final = Engine(LIBRARY)
