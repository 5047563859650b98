"""Vector instructions for kernels, written one by one, for the few loops that matter most.

Compilers use vectors of half the width in loops of many parallel sums. `vector_code` turns a
function that writes such code into one that kernels can call.

The disk cache does not see changes here: after one, empty it (``make clean``). This file loads
numba, so callers of such kernels import them where they call them.
"""

from contextlib import contextmanager
from functools import partial, wraps

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.registry import cpu_target
from numba.extending import intrinsic

_FEATURES = cpu_target.target_context.codegen().magic_tuple()[2]  # part of the cache's key

#: Floats in one vector, and the number of vectors for which the registers hold eight sums each.
WIDTH, ABREAST = (16, 2) if "+avx512f" in _FEATURES else (8, 1)

_INDEX, _LANE, _FLOAT = ir.IntType(64), ir.IntType(32), ir.FloatType()


def vector_code(result: str, known: int):
    """Decorate a function that writes vector code: kernels can then call it by its name.

    The decorator calls ``write(v, *numbers, *arguments)``: ``v`` is a `Vectors`; the first
    ``known`` arguments arrive as numbers (kernels must pass constants); arrays as `Items`; whole
    numbers and floats as values of the code. ``write`` returns a value of numba's type ``result``,
    or None for "none".
    """

    def made(write):
        @wraps(write)  # numba looks at the names of the arguments
        def typed(context, *kinds):
            if not all(isinstance(kind, types.IntegerLiteral) for kind in kinds[:known]):
                return None
            if not all(map(_is_plain, kinds[known:])):
                return None
            numbers = [kind.literal_value for kind in kinds[:known]]
            # numba distinguishes the code for other numbers only by the types of the call
            kinds = [*kinds[:known], *map(_plain, kinds[known:])]

            def codegen(context, builder, signature, arguments):
                v = Vectors(builder)
                given = [
                    Items(context, v, kind, value) if isinstance(kind, types.Array) else value
                    for kind, value in zip(signature.args, arguments, strict=True)
                ]
                value = write(v, *numbers, *given[known:])
                return context.get_dummy_value() if value is None else value

            return getattr(types, result)(*kinds), codegen

        return intrinsic(prefer_literal=True)(typed)

    return made


def _is_plain(kind):
    """Whether vector code can read it: arrays must lie item by item, of 32 bits each."""
    if not isinstance(kind, types.Array):
        return True
    return kind.layout == "C" and kind.dtype in (types.float32, types.int32)


def _plain(kind):
    """The type that vector code takes in place of ``kind``."""
    if isinstance(kind, types.Integer):
        return types.int64
    return types.float32 if isinstance(kind, types.Float) else kind


class Vectors:
    """Arithmetic on vectors of `WIDTH` float32 in the function that ``builder`` writes. Pointers
    point at single floats."""

    width = WIDTH

    def __init__(self, builder):
        self.builder = builder
        self.type = ir.VectorType(_FLOAT, WIDTH)
        self.add, self.sub, self.mul, self.over = (
            builder.fadd,
            builder.fsub,
            builder.fmul,
            builder.fdiv,
        )
        self.where = builder.select  # by lanes
        self.exceeds, self.reaches = (partial(builder.fcmp_ordered, sign) for sign in (">", ">="))
        self.abs, self.root = (partial(self._math, name) for name in ("fabs", "sqrt"))
        self.zero = ir.Constant(self.type, [0.0] * WIDTH)

    @contextmanager
    def loop(self, count):
        """Repeat the code within for each whole number from 0 to before ``count``."""
        with cgutils.for_range(self.builder, count) as loop:
            yield loop.index

    def each(self, count: int, written_out: bool):
        """Yield whole numbers from 0 to before ``count``, for a ``for`` that writes code: numbers
        whose code is ``written_out`` one after the other, or the counter of one loop."""
        if written_out:
            yield from range(count)
        else:
            with self.loop(self.number(count)) as index:
                yield index

    def variable(self, value):
        """Pointer to a new variable that begins as ``value``."""
        return cgutils.alloca_once_value(self.builder, value)

    def number(self, value: int):
        """A whole number as a value of the code."""
        return ir.Constant(_INDEX, value)

    def plus(self, first, second):
        """The sum of two whole numbers: values of the code or, either or both, numbers."""
        return self._whole(first, second, int.__add__, self.builder.add)

    def times(self, first, second):
        """The product of two whole numbers: values of the code or, either or both, numbers."""
        return self._whole(first, second, int.__mul__, self.builder.mul)

    def _whole(self, first, second, known, written):
        if isinstance(first, int) and isinstance(second, int):
            return known(first, second)
        return written(*(self.number(n) if isinstance(n, int) else n for n in (first, second)))

    def pick(self, table, index):
        """``table[index]``, from whole numbers that the compiler knows or from floats: a whole
        number as a number or a value, like ``index``; a float in all lanes."""
        table = np.asarray(table)
        whole = table.dtype.kind == "i"
        if isinstance(index, int):
            return int(table[index]) if whole else self.constant(table[index])
        kind, items = (_INDEX, table) if whole else (_FLOAT, table.astype(np.float32))
        items = cgutils.create_constant_array(kind, items.tolist())
        held = cgutils.global_constant(self.builder, "table", items)
        item = self.builder.load(self.builder.gep(held, [self.number(0), index]))
        return item if whole else self.spread(item)

    def after(self, pointer, count):
        """The pointer ``count`` items, a number or a value, after ``pointer``."""
        count = self.number(count) if isinstance(count, int) else count
        return self.builder.gep(pointer, [count])

    def load(self, pointer):
        """``width`` floats in a row."""
        return self.builder.load(self.builder.bitcast(pointer, self.type.as_pointer()), align=4)

    def store(self, a, pointer):
        """Write ``width`` floats in a row."""
        self.builder.store(a, self.builder.bitcast(pointer, self.type.as_pointer()), align=4)

    def whole(self, pointer):
        """The whole number, of 32 bits, that ``pointer`` points at."""
        return self.builder.sext(self.builder.load(pointer, align=4), _INDEX)

    def constant(self, value):
        """A known float in all lanes."""
        return ir.Constant(self.type, [float(np.float32(value))] * self.width)

    def spread(self, value):
        """A float, or the float that a pointer points at, in all lanes."""
        value = self.builder.load(value, align=4) if value.type.is_pointer else value
        kind = ir.VectorType(value.type, self.width)
        first = ir.Constant(_LANE, 0)
        vector = self.builder.insert_element(ir.Constant(kind, ir.Undefined), value, first)
        lanes = ir.Constant(ir.VectorType(_LANE, self.width), [0] * self.width)
        return self.builder.shuffle_vector(vector, vector, lanes)

    def plus_product(self, total, a, b):
        """total + a·b, in one rounding where the machine can; a total of None is 0."""
        return self.mul(a, b) if total is None else self._math("fmuladd", a, b, total)

    def larger(self, a, b):
        return self.builder.select(self.builder.fcmp_ordered(">", a, b), a, b)

    def smaller(self, a, b):
        return self.builder.select(self.builder.fcmp_ordered("<", a, b), a, b)

    def raise_to(self, pointer, a):
        """Raise the float that ``pointer`` points at to the largest of itself and all lanes."""
        most, before = self.largest(a), self.builder.load(pointer, align=4)
        higher = self.builder.fcmp_ordered(">", most, before)
        self.builder.store(self.builder.select(higher, most, before), pointer, align=4)

    def room(self, count: int):
        """Pointer to new room for ``count`` vectors in a row, of any content."""
        kind = ir.ArrayType(_FLOAT, count * self.width)
        return self.builder.bitcast(cgutils.alloca_once(self.builder, kind), _FLOAT.as_pointer())

    def largest(self, a):
        """The largest of all lanes, a float; none is NaN."""
        name = f"llvm.vector.reduce.fmax.v{self.width}f32"
        function = self._declared(name, _FLOAT, self.type)
        return self.builder.call(function, [a], fastmath=("nnan", "nsz"))

    def any(self, truths):
        """1 if any lane is true, else 0: a whole number."""
        bits = self.builder.bitcast(truths, ir.IntType(self.width))
        return self.builder.zext(self.builder.icmp_unsigned("!=", bits, bits.type(0)), _INDEX)

    def list_lanes(self, truths, first, pointer):
        """Write the numbers ``first`` + lane, int32, of the true lanes in a row; returns how many
        there are."""
        kind = ir.VectorType(_LANE, self.width)
        numbers = self.builder.add(
            self.spread(self.builder.trunc(first, _LANE)),
            ir.Constant(kind, list(range(self.width))),
        )
        name = f"llvm.masked.compressstore.v{self.width}i32"
        store = self._declared(name, ir.VoidType(), kind, pointer.type, truths.type)
        self.builder.call(store, [numbers, pointer, truths])
        bits = self.builder.bitcast(truths, ir.IntType(self.width))
        return self.builder.zext(self.builder.ctpop(bits), _INDEX)

    def _math(self, name, *arguments):
        kinds = [self.type] * len(arguments)
        function = self._declared(f"llvm.{name}.v{self.width}f32", self.type, *kinds)
        return self.builder.call(function, arguments)

    def _declared(self, name, result, *kinds):
        return cgutils.get_or_insert_function(
            self.builder.module, ir.FunctionType(result, kinds), name
        )


class Items:
    """The addresses of the items of an array argument. Strides are whole items."""

    def __init__(self, context, v: Vectors, kind, array):
        self.builder = v.builder
        made = context.make_array(kind)(context, v.builder, array)
        self.start = made.data
        self.shape = cgutils.unpack_tuple(v.builder, made.shape)
        size = ir.Constant(_INDEX, kind.dtype.bitwidth // 8)
        self.steps = [
            v.builder.sdiv(stride, size, flags=("exact",))
            for stride in cgutils.unpack_tuple(v.builder, made.strides)
        ]

    def at(self, *index):
        """Pointer to the item ``index``, one value an axis; axes left out begin at 0."""
        pointer = self.start
        for place, step in zip(index, self.steps, strict=False):
            pointer = self.builder.gep(pointer, [self.builder.mul(place, step)])
        return pointer
