"""Calls of the engine, a C++ library, by ctypes.

The library links neither Python nor numpy, so the same file works with all versions of
both. It relies on the memory layout of numpy arrays, which is the same in all versions.
The library contains descriptions of its functions and structures, see ``bindings.hpp``,
which are read when it is opened. It checks each call against them: the type and the
memory order of each array, the number of axes, and lengths that must agree. Functions
check all other conditions themselves, except for indices made by this package.

The global interpreter lock (GIL) is released during calls.
"""

import ctypes
import enum
import functools
import struct
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final, NoReturn

import numpy as np
from numpy.typing import NDArray

from radarsim.engine.build import FOLDER, LIBRARY, source_digest
from radarsim.errors import EngineError

_Bytes = ctypes.c_char * 0
# In all versions of numpy the pointer to the data follows the head of the array object.
# Reading it directly is up to five times as fast as ``array.ctypes.data``.
_HEAD: Final = object.__basicsize__
_pointer_at = ctypes.c_size_t.from_address
# Result of a refused call, as in ``bindings.hpp``, plus the number of the invalid
# argument; plus 0 if lengths do not match.
_REFUSED: Final = -(2**50)
_NO_MEMORY: Final = _REFUSED + 127


def _as_float(bits: int) -> float:
    return struct.unpack("d", struct.pack("q", bits))[0]  # type: ignore[no-any-return]


def address(array: NDArray[Any]) -> int:
    """Return the address of a contiguous array, valid during the array's lifetime."""
    return _pointer_at(id(array) + _HEAD).value


class Packed:
    """A C++ structure in memory, with the arrays and structures that it refers to.

    The fields of the structure are also attributes of this object.

    Attributes:
        structure: Type of the structure.
        fields: Values of the fields, by name.
        address: Address of the structure in memory.
    """

    def __init__(self, structure: "Structure", fields: dict[str, Any]) -> None:
        self.structure = structure
        self.fields = fields
        self._memory = bytearray(structure.size)
        self.address = ctypes.addressof(_Bytes.from_buffer(self._memory))

    def __repr__(self) -> str:
        return f"a packed {self.structure.name}"

    def __getattr__(self, name: str) -> Any:
        if name in self.fields:
            return self.fields[name]
        raise AttributeError(f"{self.structure.name} has no {name!r}")

    def __reduce__(self) -> NoReturn:
        raise TypeError(f"cannot copy {self!r}, which refers to memory of its process")


class Function:
    """A function of the engine.

    Attributes:
        codes: The codes of its parameters: ``f8``, ``&Walls`` for a packed structure,
            ``*f8[n,3]`` for an array, with ``=`` for one that is written to.
    """

    def __init__(
        self, name: str, start: int, codes: Sequence[str], labels: Sequence[str] = ()
    ) -> None:
        """Create a function from its description in the library.

        Args:
            name: Name of the function in C++.
            start: Address of the function.
            codes: The codes of the parameters, an arrow, and the code of the result.
            labels: Names of the parameters for error messages.
        """
        self._name, self.codes = name, codes[:-2]
        numbers = range(1, len(codes))
        self._labels = labels or [f"argument {i} of {name}" for i in numbers]
        self._call = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_char_p)(start)
        self._is_float = codes[-1] == "f8"

    @functools.cached_property
    def call(self) -> Callable[..., Any]:
        """A callable that calls the function with arguments in order.

        It raises an EngineError if an argument does not match its description or
        arguments do not match each other, and a MemoryError if memory is exhausted.
        """
        # Many calls are short, so everything that a call needs is prepared here.
        call, is_float, codes = self._call, self._is_float, list(enumerate(self.codes))
        arrays = list(self._dtypes)
        references = [(i, engine.structures[c[1:]]) for i, c in codes if c[0] == "&"]
        self._table = np.array([_HEAD, id(np.ndarray), *map(id, self._dtypes.values())])
        table = address(self._table)
        formats = ["d" if code == "f8" else "q" for code in self.codes]
        pack = struct.Struct("=q" + "".join(formats)).pack

        def run(*arguments: Any) -> Any:
            words = [*arguments]
            try:
                for place in arrays:
                    words[place] = id(words[place])  # the library checks the object
                for place, structure in references:
                    value = words[place]
                    words[place] = value.address if value.structure is structure else ""
                block = pack(table, *words)
            except (AttributeError, IndexError, TypeError, struct.error):
                raise self._unexpected(arguments) from None
            result = call(block)
            if result < 0 and _REFUSED <= result <= _NO_MEMORY:
                return self._call_again(arguments, result)
            return _as_float(result) if is_float else result

        return run

    @functools.cached_property
    def _dtypes(self) -> dict[int, np.dtype[Any]]:
        """The types of array arguments, by the index of the argument."""
        codes = {i: code for i, code in enumerate(self.codes) if code[0] in "*="}
        kinds = {i: code[1:].partition("[")[0] for i, code in codes.items()}
        return {i: engine.rows.get(k) or np.dtype(k) for i, k in kinds.items()}

    def _call_again(self, arguments: Sequence[Any], result: int) -> Any:
        """Repeat a refused call with a view of the array, if that has the right type.

        Otherwise raise the error for the refused argument.
        """
        if result == _NO_MEMORY:
            raise MemoryError(f"there is too little memory for {self._name}")
        if result == _REFUSED:
            text = "inconsistent lengths or indices"
            raise EngineError(f"{self._name} was called with {text}")
        place, others = result - _REFUSED - 1, [*arguments]
        array, dtype = others[place], self._dtypes[place]
        is_equal = isinstance(array, np.ndarray) and array.dtype == dtype
        if is_equal and (type(array) is not np.ndarray or array.dtype is not dtype):
            others[place] = array.view(dtype, np.ndarray)
            return self.call(*others)
        raise self._unexpected_array(arguments, place)

    def _unexpected(self, arguments: Sequence[Any]) -> EngineError | TypeError:
        """Return the error for arguments that are numbers or structures."""
        for label, code, value in zip(
            self._labels, self.codes, arguments, strict=False
        ):
            if code[0] == "&":
                if not (isinstance(value, Packed) and value.structure.name == code[1:]):
                    text = f"{label} is {value!r}, expected a packed {code[1:]}"
                    return EngineError(text)
            elif code[0] not in "*=":
                try:
                    struct.pack("d" if code == "f8" else "q", value)
                except (TypeError, struct.error):
                    return EngineError(f"{label} is {value!r}, expected a number")
        return TypeError(f"{len(arguments)} arguments for {self._name}{self.codes}")

    def _unexpected_array(self, arguments: Sequence[Any], place: int) -> EngineError:
        lengths: dict[str, int] = {}
        for i in self._dtypes:
            axes = self.codes[i].removesuffix("]").partition("[")[2].split(",")
            if i == place:
                break
            lengths = dict(zip(axes, arguments[i].shape, strict=True)) | lengths
        value, code = arguments[place], self.codes[place]
        came = repr(value)
        if isinstance(value, np.ndarray):
            came = f"an array {value.dtype}{list(value.shape)}"
            came += "" if value.flags.c_contiguous else ", not contiguous"
            came += "" if value.flags.writeable else ", read-only"
        written = " to write to" if code[0] == "=" else ""
        named = [axis for axis in axes if axis in lengths and axis.isalpha()]
        where = ", ".join(f"{axis} = {lengths[axis]}" for axis in named)
        where = f" where {where}" if where else ""
        return EngineError(
            f"{self._labels[place]} is {came}, expected an array"
            f" {code[1:]}{written}{where}"
        )


class Structure:
    """The description of a C++ structure that refers to arrays.

    Attributes:
        name: Name of the structure in C++.
        size: Size of the structure in bytes.
        codes: The code of each field, by name.
    """

    def __init__(self, name: str, size: int, start: int, fields: Sequence[str]) -> None:
        """Create a structure from its description in the library.

        Args:
            name: Name of the structure in C++.
            size: Size of the structure in bytes.
            start: Address of the function that fills the structure.
            fields: Name, offset in bytes, and code of each field, one after the other.
        """
        self.name, self.size = name, size
        self.codes = dict(zip(fields[::3], fields[2::3], strict=True))
        labels = ["memory", *(f"{name}.{field}" for field in self.codes)]
        codes = ["u8", *self.codes.values(), "->", "i8"]
        self._fill = Function(name, start, codes, labels)

    def pack(self, **values: Any) -> Packed:
        """Pack values into a structure without copying arrays.

        Args:
            values: A value for each field.

        Raises:
            EngineError: If a value does not match its description, or is missing.
        """
        if values.keys() != self.codes.keys():
            unknown = sorted(values.keys() ^ self.codes.keys())
            raise EngineError(f"{self.name}: fields {unknown} are missing or unknown")
        packed = Packed(self, values)
        self._fill.call(packed.address, *[values[name] for name in self.codes])
        return packed


def _row_type(size: int, fields: Sequence[str]) -> np.dtype[np.void]:
    """Return the numpy type of a structure of numbers, for structured arrays.

    Args:
        size: Size of the structure in bytes.
        fields: Name, offset in bytes, and code of each field, one after the other.
    """
    kinds = [code.removesuffix("]").partition("[") for code in fields[2::3]]
    formats = [(kind, (int(count),)) if count else kind for kind, _, count in kinds]
    offsets = [int(offset) for offset in fields[1::3]]
    return np.dtype(
        {
            "names": fields[::3],
            "formats": formats,
            "offsets": offsets,
            "itemsize": size,
        }
    )


class Engine:
    """The engine's library, with its functions as attributes.

    Attributes:
        functions: Descriptions of the functions, by their names in C++.
        rows: Numpy types of structures that are rows of arrays, by their names in C++.
        structures: Descriptions of structures that are packed, by their names in C++.
        enumerations: Enumerations, by their names in C++.
    """

    def __init__(self, path: Path) -> None:
        """Open the library.

        Raises:
            EngineError: If the library cannot be opened, or was compiled from other
                sources.
        """
        try:
            library = ctypes.CDLL(str(path))
        except OSError as error:
            raise EngineError(
                f"cannot use {path}: {error}; it is compiled when radarsim is installed"
            ) from error
        for name in ("describe", "sources"):
            getattr(library, f"radarsim_{name}").restype = ctypes.c_char_p
        # Only a checkout has the source files.
        if (FOLDER / "engine.cpp").exists():
            built = library.radarsim_sources().decode()
            if built != source_digest():
                raise EngineError(
                    f"{path} was built from other sources; compile it again by"
                    " 'pip install -e .', or by 'python radarsim/engine/build.py'"
                    " where ziglang is installed"
                )
        self.functions: dict[str, Function] = {}
        self.rows: dict[str, np.dtype[np.void]] = {}
        self.structures: dict[str, Structure] = {}
        self.enumerations: dict[str, Any] = {}
        for line in library.radarsim_describe().decode().splitlines():
            name, kind, size, start, *codes = line.split()
            match kind:
                case "row":
                    self.rows[name] = _row_type(int(size), codes)
                case "structure":
                    structure = Structure(name, int(size), int(start), codes)
                    self.structures[name] = structure
                case "enumeration":
                    members = "".join(codes).split(",")
                    self.enumerations[name] = enum.IntEnum(name, members, start=0)
                case _:
                    self.functions[name] = Function(name, int(start), codes)

    def __getattr__(self, name: str) -> Any:
        if name not in self.functions:
            raise AttributeError(f"the engine has no function {name!r}")
        call = self.functions[name].call
        setattr(self, name, call)  # so that ``__getattr__`` is not called again
        return call


engine: Final = Engine(LIBRARY)
