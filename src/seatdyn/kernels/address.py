"""Named tuples of arrays handed on by their address.

Compiled functions pass a tuple of arrays as its numbers, some ten for each array: pushing those of
a plant and a ladder takes longer than most of what is done with them. An address is one number, and
its fields read as those of the tuple.
"""

from __future__ import annotations

from llvmlite import ir
from numba import types
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
