"""Arithmetic on lanes: several complex numbers at a time, with one instruction for all real or imaginary parts.

A vector of lanes is `2 LANES` numbers in a row of a one-dimensional array, real parts first; an index counts such vectors. A
compiler makes vector instructions of a loop only if it knows that arrays do not overlap, so vector instructions are given to
LLVM directly.
"""

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

LANES = 8
_VECTOR = ir.VectorType(ir.DoubleType(), LANES)
_ZEROS = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
_NONE = ir.Constant(_VECTOR, ir.Undefined)


class _Builder:
    """The parts of an intrinsic; given: its arguments, of the types `kinds`."""

    def __init__(self, context, builder, kinds, given):
        self.context, self.builder, self.kinds, self.given = context, builder, kinds, given

    def place(self, array, index, part):
        """Return the address of the vector of that index; array, index: numbers of arguments."""
        at = self.builder.mul(self.given[index], self.given[index].type(2 * LANES))
        at = self.builder.add(at, at.type(part * LANES))
        data = self.context.make_array(self.kinds[array])(self.context, self.builder, self.given[array]).data
        return self.builder.bitcast(self.builder.gep(data, [at]), _VECTOR.as_pointer())

    def read(self, array, index):
        """Return the real and the imaginary parts of a vector."""
        parts = [self.builder.load(self.place(array, index, part)) for part in range(2)]
        for part in parts:
            part.align = 8
        return parts

    def write(self, array, index, parts):
        """Store the real and the imaginary parts in a vector."""
        for number, part in enumerate(parts):
            self.builder.store(part, self.place(array, index, number)).align = 8
        return self.context.get_dummy_value()

    def alike(self, number):
        """Return a vector with a real number in every lane."""
        one = self.builder.insert_element(_NONE, number, ir.IntType(32)(0))
        return self.builder.shuffle_vector(one, _NONE, _ZEROS)

    def product(self, a, b):
        """Return the product of complex numbers."""
        by, plus, minus = self.builder.fmul, self.builder.fadd, self.builder.fsub
        return minus(by(a[0], b[0]), by(a[1], b[1])), plus(by(a[0], b[1]), by(a[1], b[0]))

    def square(self, a):
        """Return the square of the modulus."""
        return self.builder.fadd(self.builder.fmul(a[0], a[0]), self.builder.fmul(a[1], a[1]))

    def named(self, name, a):
        """Return LLVM's own function of a vector."""
        module, whole = self.builder.module, f"{name}.v{LANES}f64"
        known = module.globals.get(whole) or ir.Function(module, ir.FunctionType(_VECTOR, [_VECTOR]), whole)
        return self.builder.call(known, [a])


def _lanes(build, *kinds):
    """Return the signature of an intrinsic, `kinds` being types of its arguments, and the function that builds it."""

    def generated(context, builder, signature, given):
        return build(_Builder(context, builder, signature.args, given))

    return types.void(*kinds), generated


@intrinsic
def less(typing, x, i, a, k, y, j):
    """x[i] -= a[k] y[j]."""

    def build(b):
        product = b.product(b.read(2, 3), b.read(4, 5))
        return b.write(0, 1, [b.builder.fsub(*pair) for pair in zip(b.read(0, 1), product, strict=True)])

    return _lanes(build, x, types.intp, a, types.intp, y, types.intp)


@intrinsic
def times(typing, x, i, a, k):
    """x[i] *= a[k]."""
    return _lanes(lambda b: b.write(0, 1, b.product(b.read(0, 1), b.read(2, 3))), x, types.intp, a, types.intp)


@intrinsic
def put(typing, x, i, factor, y, j):
    """x[i] = factor y[j], the factor being one real number."""

    def build(b):
        factor = b.alike(b.given[2])
        return b.write(0, 1, [b.builder.fmul(factor, part) for part in b.read(3, 4)])

    return _lanes(build, x, types.intp, types.float64, y, types.intp)


@intrinsic
def more(typing, x, i, factor, y, j):
    """x[i] += factor y[j], the factor being one real number."""

    def build(b):
        factor = b.alike(b.given[2])
        added = [b.builder.fmul(factor, part) for part in b.read(3, 4)]
        return b.write(0, 1, [b.builder.fadd(*pair) for pair in zip(b.read(0, 1), added, strict=True)])

    return _lanes(build, x, types.intp, types.float64, y, types.intp)


@intrinsic
def inverted(typing, x, i):
    """x[i] = 1/x[i]."""

    def build(b):
        real, imag = b.read(0, 1)
        square = b.square((real, imag))
        return b.write(0, 1, (b.builder.fdiv(real, square), b.builder.fneg(b.builder.fdiv(imag, square))))

    return _lanes(build, x, types.intp)


@intrinsic
def sized(typing, x, i, y, j):
    """x[i] = |y[j]|."""

    def build(b):
        return b.write(0, 1, (b.named("llvm.sqrt", b.square(b.read(2, 3))), ir.Constant(_VECTOR, [0.0] * LANES)))

    return _lanes(build, x, types.intp, y, types.intp)


@intrinsic
def outgrown(typing, x, i, y, j):
    """Set the real parts of x[i] to the larger of themselves and of the sum of the sizes of both parts of y[j]."""

    def build(b):
        largest = b.read(0, 1)
        size = b.builder.fadd(*(b.named("llvm.fabs", part) for part in b.read(2, 3)))
        largest[0] = b.builder.select(b.builder.fcmp_ordered(">", size, largest[0]), size, largest[0])
        return b.write(0, 1, largest)

    return _lanes(build, x, types.intp, y, types.intp)
