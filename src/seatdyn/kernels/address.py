"""Named tuples of arrays handed on by their address.

Compiled functions pass a tuple of arrays as its numbers, some ten for each array: pushing those of
a plant and a ladder takes longer than most of what is done with them. An address is one number, and
its fields read as those of the tuple.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import typeof, types
from numba.core import cgutils
from numba.core.imputils import impl_ret_borrowed
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    infer_getattr,
    intrinsic,
    lower_getattr_generic,
    models,
    register_model,
)


class Address(types.Type):
    """Address of a named tuple that a calling function keeps."""

    def __init__(self, pointee: types.NamedTuple) -> None:
        """Keep what stands there."""
        self.pointee = pointee
        super().__init__(name=f"Address({pointee})")


@register_model(Address)
class _AddressModel(models.PrimitiveModel):
    def __init__(self, dmm, address):
        super().__init__(dmm, address, dmm.lookup(address.pointee).get_value_type().as_pointer())


@infer_getattr
class _Fields(AttributeTemplate):
    key = Address

    def generic_resolve(self, address, field):
        fields = address.pointee.fields
        return address.pointee[fields.index(field)] if field in fields else None


@lower_getattr_generic(Address)
def _field(context, builder, address, pointer, field):
    i = address.pointee.fields.index(field)
    found = builder.load(cgutils.gep_inbounds(builder, pointer, 0, i))
    return impl_ret_borrowed(context, builder, address.pointee[i], found)


@intrinsic
def address_of(typingctx, named):
    """Address of a copy of the tuple, for as long as this function runs.

    It does not keep the arrays: they have to outlive it, see `keep`.
    """

    def codegen(context, builder, sig, args):
        return cgutils.alloca_once_value(builder, args[0])

    return Address(named)(named), codegen


@intrinsic
def keep(typingctx, named):
    """Keep the arrays of the tuple up to here."""

    def codegen(context, builder, sig, args):
        return ir.Constant(ir.IntType(1), 0)

    return types.boolean(named), codegen


def placed(named: Any, kind: Address) -> np.ndarray:  # type: ignore[type-arg]
    """Lay a named tuple of arrays and numbers out as compiled code does, without who owns them.

    A kernel that is handed this instead of the tuple does not look at every array again (`at`).
    The arrays have to outlive it.
    """
    if typeof(named) != kind.pointee:
        raise TypeError(f"{typeof(named)} is not {kind.pointee}")
    words: list[int] = []
    for field in named:
        if isinstance(field, np.ndarray):
            words += [0, 0, field.size, field.itemsize, field.ctypes.data]
            words += [*field.shape, *field.strides]
        else:
            words.append(int(field))
    return np.array(words, dtype=np.int64)


def at(kind: Address) -> Any:
    """Make the function that gives the address of a tuple that was `placed`."""

    @intrinsic
    def address_in(typingctx, words):
        def codegen(context, builder, sig, args):
            data = context.make_array(sig.args[0])(context, builder, args[0]).data
            return builder.bitcast(data, context.get_value_type(kind))

        return kind(words), codegen

    return address_in
