"""Machine code without the compiler: called, kept in files, and loaded in some milliseconds.

Numba takes as long to import as a small conversion to compute, and only whoever compiles needs it.
What it makes of a function that Python calls (:mod:`adv2e.compilation.translation`) therefore lies
in files that LLVM alone loads, and is called with all arguments laid out in memory as C lays out a
struct.

LLVM is used by its package ``llvmlite``, which Numba is built on and brings along.
"""

from __future__ import annotations

import ctypes
import hashlib
import json
import os
import struct
import threading
from collections.abc import Callable, Hashable
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from adv2e.compilation.kept import read_kept, write_kept

_NUMBERS = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "i8": "q", "u8": "Q"}
_NUMBERS |= {"f4": "f", "f8": "d", "b1": "?"}
_BEYOND_INT64 = 1 << 63
_CALLED = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p)
_LOADING = threading.Lock()


@dataclass(frozen=True)
class Code:
    """Machine code of a function for arguments of one kind."""

    symbol: str
    """Where it begins: int symbol(const void *arguments, void *returned), 0: all went well."""
    returned: str
    """Format of the number that it returns, as of `struct`, of several in brackets; "": none."""
    needed: tuple[str, ...]
    """Functions in other libraries that it calls."""
    binary: bytes
    """An object file."""


NOT_SO = Code("", "", (), b"")
"""Stands for code that can be made, loaded or called by Numba only."""


class Refused(TypeError):
    """A value of a kind that machine code is not called with."""


def lay_out(values: tuple[Any, ...]) -> tuple[Hashable, list[Any]]:
    """Return the kind of a tuple of values, and all that is in them, one after the other.

    Raises
    ------
    Refused
        A value is no number, no array and no tuple of these.
    """
    kinds: list[Hashable] = [type(values)]
    contents: list[Any] = []
    for value in values:
        if isinstance(value, np.ndarray):
            kinds.append(_lay_out_array(value, contents))
        elif isinstance(value, tuple):
            kind, inner = lay_out(value)
            kinds.append(kind)
            contents += inner
        else:
            kinds.append(_kind_of_number(value))
            contents.append(value)
    return tuple(kinds), contents


def _lay_out_array(array: np.ndarray[Any, Any], contents: list[Any]) -> Hashable:
    flags = array.flags
    layout = "C" if flags.c_contiguous else "F" if flags.f_contiguous else "A"
    # first what counts references in Numba: nothing does
    contents += [0, 0, array.size, array.itemsize, array.__array_interface__["data"][0]]
    contents += array.shape
    contents += array.strides
    return _Array(array.dtype, array.ndim, layout, flags.writeable, flags.aligned)


class _Array(NamedTuple):
    dtype: np.dtype[Any]
    axes: int
    layout: str
    writeable: bool
    aligned: bool


def _kind_of_number(value: Any) -> str:
    if isinstance(value, bool):
        return "?"
    if isinstance(value, int):
        return "q" if value < _BEYOND_INT64 else "Q"
    if isinstance(value, float):
        return "d"
    if isinstance(value, np.generic) and value.dtype.str[1:] in _NUMBERS:
        return _NUMBERS[value.dtype.str[1:]]
    raise Refused(f"{type(value).__name__} is neither a number nor an array")


def _format(kind: Any) -> tuple[str, str]:
    """Return the format of a kind, and of a number that is aligned as all of it is."""
    if isinstance(kind, str):
        return kind, kind
    if isinstance(kind, _Array):
        return f"PPqqP{2 * kind.axes}q", "P"
    parts = [_format(one) for one in kind[1:]]
    widest = max((align for _, align in parts), key=struct.calcsize, default="B")
    return f"0{widest}" + "".join(part for part, _ in parts) + f"0{widest}", widest


def described(kind: Any) -> str:
    """Return a kind in words that are the same in every process."""
    if isinstance(kind, str):
        return kind
    if isinstance(kind, _Array):
        return repr((kind.dtype.descr, *kind[1:]))
    names = getattr(kind[0], "_fields", ())
    return f"{kind[0].__qualname__}{names}({', '.join(map(described, kind[1:]))})"


@cache
def _llvm() -> Any:
    """Return LLVM, ready to load code for this machine."""
    # late, so that what never computes, such as `adv2e --help`, does without
    import llvmlite.binding as llvm  # noqa: PLC0415

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm


@cache
def machine() -> str:
    """Return what names the processor, and how Numba is told to use it."""
    llvm = _llvm()
    told = [f"{name}={value}" for name, value in sorted(os.environ.items()) if "NUMBA_CPU" in name]
    named = [llvm.get_default_triple(), llvm.get_host_cpu_name()]
    with suppress(RuntimeError):  # not every processor lists what it can
        named.append(llvm.get_host_cpu_features().flatten())
    return " ".join([*named, *told])


@cache
def _engine() -> Any:
    """Return what holds the code; from here on LLVM finds by name what the process has."""
    llvm = _llvm()
    target = llvm.Target.from_default_triple().create_target_machine(jit=True)
    return llvm.create_mcjit_compiler(llvm.parse_assembly(""), target)


def load(code: Code, kind: Any) -> Callable[[list[Any]], Any] | None:
    """Return a function that runs `code` on the contents of values of its kind (:func:`lay_out`).

    None: it is NOT_SO, this process lacks what the code calls, or LLVM does not find its way in it.
    While the code runs, the interpreter lock is released; the caller keeps the arrays alive.
    """
    with _LOADING, suppress(RuntimeError):  # as LLVM raises
        engine = _engine()
        if not code.symbol or not all(map(_llvm().address_of_symbol, code.needed)):
            return None  # LLVM would end the process
        engine.add_object_file(_llvm().ObjectFileRef.from_data(code.binary))
        engine.finalize_object()
        address = engine.get_function_address(code.symbol)
        if address:
            return _caller(_CALLED(address), code.returned, kind)
    return None


def _caller(function: Any, returned: str, kind: Any) -> Callable[[list[Any]], Any]:
    several = returned.startswith("(")
    layout, result = struct.Struct("@" + _format(kind)[0]), struct.Struct(returned.strip("()"))

    def call(contents: list[Any]) -> Any:
        numbers = ctypes.create_string_buffer(result.size)
        if function(layout.pack(*contents), numbers) != 0:
            raise MemoryError("no memory for more events")
        made = result.unpack(numbers)
        return made if several else made[0] if made else None

    return call


def file_of(folder: Path, name: str, kind: Any) -> Path:
    """Return the file for the code of the function `name` for one kind on this machine."""
    digest = hashlib.sha256(f"{machine()} {described(kind)}".encode()).hexdigest()[:24]
    return folder / f"{name}-{digest}.code"


def read_code(path: Path) -> Code | None:
    """Return the code in a file; None where there is none, or not all of it."""
    kept = read_kept(path)
    if kept is None:
        return None
    head, _, binary = kept.partition(b"\n")
    known = json.loads(head)
    return Code(**{**known, "needed": tuple(known["needed"])}, binary=binary)


def write_code(path: Path, code: Code) -> None:
    """Keep code in a file, if that is possible; other processes see all of it or nothing."""
    head = {key: value for key, value in asdict(code).items() if key != "binary"}
    write_kept(path, json.dumps(head).encode() + b"\n" + code.binary)
