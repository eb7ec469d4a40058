"""Calls of a law's functions, which compiled code knows by their addresses.

The engine is compiled once, whatever laws there are: a law's functions are compiled apart and
called through pointers. numba's own first-class functions do the same, but an argument of that kind
takes 25 microseconds at each call from Python, an address a fraction of one.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba

_numba: Any = numba

#: Functions by address where nothing is compiled (NUMBA_DISABLE_JIT=1).
PLAIN: dict[int, Callable[..., None]] = {}


def _call_plain(address, numbers, own, bodies, links, motions, gravity):
    """Call a law's function: see `call_law`."""
    PLAIN[int(address)](numbers, own, bodies, links, motions, gravity)


def _intrinsic() -> Any:
    """Return `call_law` for compiled code."""
    from llvmlite import ir
    from numba.core import types
    from numba.extending import intrinsic

    @intrinsic
    def call_law(typing_context, address, numbers, own, bodies, links, motions, gravity):
        arrays = (numbers, own, bodies, links, motions, gravity)

        def generate(context, builder, signature, arguments):
            pointer, size = ir.IntType(8).as_pointer(), ir.IntType(64)
            data = []
            for kind, value in zip(signature.args[1:], arguments[1:], strict=True):
                array = context.make_array(kind)(context, builder, value)
                data.append(builder.bitcast(array.data, pointer))
            joints = context.make_array(signature.args[1])(context, builder, arguments[1])
            rows = context.make_array(signature.args[2])(context, builder, arguments[2])
            sizes = [builder.extract_value(array.shape, 0) for array in (joints, rows)]
            kinds = [pointer] * len(data) + [size] * len(sizes)
            function = ir.FunctionType(ir.VoidType(), kinds).as_pointer()
            builder.call(builder.inttoptr(arguments[0], function), data + sizes)
            return context.get_dummy_value()

        return types.void(types.int64, *arrays), generate

    return call_law


#: ``call_law(address, numbers, own, bodies, links, motions, gravity)``, arrays as in
#: `records.Controller`.
call_law = _call_plain if _numba.config.DISABLE_JIT else _intrinsic()
