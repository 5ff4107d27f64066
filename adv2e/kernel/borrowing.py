"""Views whose reference counts Numba does not update (borrowed references).

Numba counts the references to each array atomically: a function of some arithmetic that takes eight
arrays takes twice as long for it.  Functions that are called for each
strip or pixel therefore begin by borrowing their arrays; their callers
keep the memory.
"""

from __future__ import annotations

from adv2e.compiled import extension


def borrowed(*values):
    """Return arrays, and tuples of arrays and numbers, whose references are not counted.

    They are valid as long as those given are.
    """
    return values


@extension
def _compile_borrowed():
    from numba import types  # noqa: PLC0415 - for the compiler only
    from numba.extending import intrinsic, overload  # noqa: PLC0415

    def without_owner(context, builder, kind, value):
        if isinstance(kind, types.Array):
            array = context.make_array(kind)(context, builder, value)
            array.meminfo = array.meminfo.type(None)
            return array._getvalue()
        if isinstance(kind, types.BaseTuple):
            parts = [
                without_owner(context, builder, part, builder.extract_value(value, k))
                for k, part in enumerate(kind)
            ]
            return context.make_tuple(builder, kind, parts)
        return value

    @intrinsic
    def borrow_tuple(_, values):
        def generate(context, builder, signature, arguments):
            return without_owner(context, builder, signature.return_type, arguments[0])

        return values(values), generate

    @overload(borrowed)
    def borrow(*values):
        return lambda *values: borrow_tuple(values)
