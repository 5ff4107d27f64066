"""Python functions into machine code, by Numba, and Numba's own cache of it.

Whatever imports this imports Numba.  What Numba does not promise to keep as it is, its cache and
the layout of arguments, is used with the releases that were tried; see :func:`translate`.
"""

from __future__ import annotations

import hashlib
import pickle
import re
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numba
from numba import extending
from numba.core import cgutils, compiler, compiler_lock, dispatcher, registry, serialize, types
from numba.core.datamodel import packer

from adv2e.compilation.kept import read_kept, write_kept
from adv2e.compilation.machine_code import NOT_SO, Code

_Result: Any = compiler.CompileResult
_dumps: Any = serialize.dumps
_numba: Any = numba
_ir: Any = vars(cgutils)["ir"]
_Packer: Any = packer.DataPacker
_target: Any = registry.cpu_target
_OWN = "NRT_", "numba_", "Numba"
_RETURNED = {
    types.int64: "q",
    types.uint64: "Q",
    types.float64: "d",
    types.boolean: "?",
    types.none: "",
}


class _Kept:
    """The compiled code of one function as Numba keeps it, in a file for each signature.

    It stands in for Numba's own cache, which numbers its files, so that two processes that fill it
    at once may take the code of one signature for that of another, and loads damaged ones.
    """

    cache_path = ""

    def __init__(self, function: Callable[..., Any], folder: Path) -> None:
        self._function = function
        self._folder = folder / "numba"

    def _file(self, signature: Any, codegen: Any) -> Path:
        function = self._function
        code = function.__code__
        cells = tuple(cell.cell_contents for cell in function.__closure__ or ())
        made_of = (code.co_firstlineno, code.co_code, _dumps(cells) if cells else b"")
        told = (str(signature), codegen.magic_tuple(), made_of)
        digest = hashlib.sha256(repr(told).encode()).hexdigest()[:24]
        name = re.sub("[<>]", "", f"{function.__module__}.{function.__qualname__}")
        return self._folder / f"{name}-{digest}.nbc"

    def load_overload(self, signature: Any, context: Any) -> Any:
        """Return the compiled code for a signature, or None."""
        context.refresh()
        with suppress(Exception):  # another release of Numba may go about it in another way
            data = read_kept(self._file(signature, context.codegen()))
            return data and _Result._rebuild(context, *pickle.loads(data))
        return None

    def save_overload(self, signature: Any, result: Any) -> None:
        """Keep the compiled code for a signature, if that is possible."""
        with suppress(Exception):
            if not (result.lifted or result.library.has_dynamic_globals):  # of this process alone
                data = _dumps(result._reduce())
                write_kept(self._file(signature, result.codegen), data)

    def enable(self) -> None:
        """Do nothing: it is in use."""

    def disable(self) -> None:
        """Do nothing: it is in use."""

    def flush(self) -> None:
        """Do nothing: what is kept stays."""


def make_dispatcher(
    function: Callable[..., Any], folder: Path, *, cached: bool, **options: Any
) -> Any:
    """Return Numba's stand-in for a function, whose machine code is kept below `folder`.

    Without Numba's run-time (``_nrt``) there is no counting of references to arrays, which costs
    more than the arithmetic of a short function.
    """
    options |= {"nogil": True, "error_model": "numpy", "fastmath": {"contract"}, "_nrt": False}
    # nobody calls it as a function of C: a twentieth of the time to compile
    made: Any = _numba.njit(no_cfunc_wrapper=True, **options)(function)
    if cached:
        made._cache = _Kept(function, folder)
    return made


def make_intrinsic(function: Callable[..., Any]) -> Any:
    """Return the intrinsic that a function describes; see :func:`numba.extending.intrinsic`."""
    return extending.intrinsic(function)


def type_of_intrinsic(made: Any) -> Any:
    """Return what Numba takes an intrinsic for where compiled code names it."""
    _target.typing_context.refresh()  # it was made a moment ago
    return _target.typing_context.resolve_value_type(made)


def translate(made: Any, arguments: tuple[Any, ...]) -> Code:
    """Return the code of a function for arguments like these.

    It is ``NOT_SO`` where Numba goes about it in another way than in the releases that were tried
    (0.59 to 0.68), where the code needs Numba's run-time, or where it returns more than numbers.

    Parameters
    ----------
    made
        What :func:`make_dispatcher` returned.
    arguments
        Of a call.

    Raises
    ------
    numba.core.errors.NumbaError
        The function cannot be compiled for such arguments.
    """
    kinds = tuple(_numba.typeof(argument) for argument in arguments)
    with compiler_lock.global_compiler_lock:
        try:
            return _finish(_unfinished(made, kinds), kinds)
        except (AttributeError, TypeError, ValueError, RuntimeError):
            return NOT_SO


def _unfinished(made: Any, kinds: tuple[Any, ...]) -> Any:
    """Return a function compiled up to where more code can be added that calls it."""
    compilers: Any = dispatcher

    class Unfinished(compilers._FunctionCompiler):  # type: ignore[misc]
        def _customize_flags(self, flags: Any) -> Any:
            flags.no_cpython_wrapper = True
            flags.no_cfunc_wrapper = True
            flags.no_compile = True
            return flags

    options = made.targetoptions
    return Unfinished(made.py_func, _target, options, {}, compiler.Compiler).compile(kinds, None)


def _finish(unfinished: Any, kinds: tuple[Any, ...]) -> Code:
    """Return the code, with a function that takes the arguments from memory."""
    described, library, context = unfinished.fndesc, unfinished.library, _target.target_context
    returned = _format(unfinished.signature.return_type)
    if returned is None:
        return NOT_SO
    symbol = f"{described.llvm_func_name}.from_memory"
    library.add_ir_module(_from_memory(library, context, described, symbol, kinds))
    library.enable_object_caching()
    library.finalize()
    _, _, (binary, _) = library.serialize_using_object_code()
    calls = [
        one.name
        for one in library._final_module.functions
        if one.is_declaration and not one.name.startswith("llvm.")
    ]
    if any(name.startswith(_OWN) for name in calls):
        return NOT_SO
    return Code(symbol, returned, tuple(sorted(calls)), binary)


def _format(returned: Any) -> str | None:
    """Return the format of what a function returns; None: none for :class:`Code`."""
    if not isinstance(returned, types.BaseTuple):
        return _RETURNED.get(returned)
    several: Any = returned
    parts = [_RETURNED.get(one) for one in several]
    return f"({''.join(map(str, parts))})" if all(parts) else None


def _from_memory(
    library: Any, context: Any, described: Any, symbol: str, kinds: tuple[Any, ...]
) -> Any:
    """Return a module with ``int symbol(const void *arguments, void *returned)``."""
    packed = _Packer(context.data_model_manager, kinds)
    anything = _ir.IntType(8).as_pointer()
    module = library.create_ir_module(symbol)
    function = _ir.Function(
        module, _ir.FunctionType(_ir.IntType(32), [anything, anything]), name=symbol
    )
    builder = _ir.IRBuilder(function.append_basic_block())
    layout = _ir.LiteralStructType(packed._be_types)
    place = builder.bitcast(function.args[0], layout.as_pointer())
    arguments = [value for _, value in packed.load(builder, place)]
    callee = context.declare_function(module, described)
    status, result = context.call_conv.call_function(
        builder, callee, described.restype, described.argtypes, arguments
    )
    if described.restype is not types.none:
        model = context.data_model_manager[described.restype]
        value = model.as_data(builder, result)
        builder.store(value, builder.bitcast(function.args[1], value.type.as_pointer()))
    builder.ret(status.code)
    return module
