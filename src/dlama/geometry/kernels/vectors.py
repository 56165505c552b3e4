"""Numbers of a picture and places in them in; sums over the pixels there out, several numbers in one register.

numba computes such sums one number at a time, which takes twice as long; so LLVM's vectors are written out here.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import config, types
from numba.extending import intrinsic

from dlama.geometry.kernels.jit import Real
from dlama.geometry.rgbd import Float32Array

Four = tuple[Real, Real, Real, Real]
"""Weights of four pixels."""
LANES, PICKED = 4, ir.IntType(32)
"""Numbers of a vector: the three channels and one that nothing reads; type of a lane's number."""
WIDE, RUN = 8, 35
"""Numbers of a vector, and in all, that `squared_difference` compares."""


def add_one_by_one(knots: Float32Array, first: int, row: int, along: Four, down: Four) -> tuple[Any, Any, Any]:
    """`four_by_four` in Python: where numba is turned off, and for tests."""
    rows = []
    for number in range(int(first), int(first + 4 * row), int(row)):
        pixels = knots[number : number + 12].reshape(4, 3)
        rows.append(along[0] * pixels[0] + along[1] * pixels[1] + along[2] * pixels[2] + along[3] * pixels[3])
    red, green, blue = (down[0] * rows[0] + down[1] * rows[1]) + (down[2] * rows[2] + down[3] * rows[3])
    return red, green, blue


def spread(builder: Any, number: Any) -> Any:
    """A vector whose lanes all are that number."""
    vector = ir.Constant(ir.VectorType(number.type, LANES), ir.Undefined)
    one = builder.insert_element(vector, number, PICKED(0))
    return builder.shuffle_vector(one, vector, ir.Constant(ir.VectorType(PICKED, LANES), [0] * LANES))


def weigh(builder: Any, weights: Any, vectors: list[Any]) -> list[Any]:
    """Each vector times its weight."""
    return [builder.fmul(spread(builder, builder.extract_value(weights, n)), one) for n, one in enumerate(vectors)]


def load(builder: Any, data: Any, at: Any, lanes: int) -> Any:
    """The vector of so many float32 at a flat place."""
    vector = ir.VectorType(ir.FloatType(), lanes)
    return builder.load(builder.bitcast(builder.gep(data, [at]), vector.as_pointer()), align=4)


def load_pixel(builder: Any, data: Any, at: Any, number: Any) -> Any:
    """The vector at a flat place of float32 coefficients, its lanes of the type `number`."""
    pixel = load(builder, data, at, LANES)
    return pixel if number == ir.FloatType() else builder.fpext(pixel, ir.VectorType(number, LANES))


def add_pixels(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """The instructions of `four_by_four`."""
    knots, at, row, along, down = arguments
    data = context.make_array(signature.args[0])(context, builder, knots).data
    rows = []
    for _ in range(4):
        places = [builder.add(at, at.type(3 * number)) for number in range(4)]
        total, *others = weigh(builder, along, [load_pixel(builder, data, one, along.type.element) for one in places])
        for other in others:
            total = builder.fadd(total, other)
        rows.append(total)
        at = builder.add(at, row)
    first, second, third, last = weigh(builder, down, rows)
    color = builder.fadd(builder.fadd(first, second), builder.fadd(third, last))
    channels = [builder.extract_element(color, PICKED(number)) for number in range(3)]
    return context.make_tuple(builder, signature.return_type, channels)


@intrinsic
def add_vectors(typing: Any, knots: Any, first: Any, row: Any, along: Any, down: Any) -> Any:
    """`four_by_four` for kernels. It reads one number beyond the last pixel."""
    color = types.UniTuple(along.dtype, 3)
    return color(knots, types.uintp, types.uintp, along, down), add_pixels


four_by_four: Any = add_one_by_one if vars(config)["DISABLE_JIT"] else add_vectors
"""Red, green and blue of 4 x 4 pixels: those of a row weighted and added from left to right, then the rows in pairs.

knots: H W 3, flat, and one number more; then the flat place of the first of the pixels, the flat step to the next row, and the
weights along a row and down a column, float32 or float64.
"""


def compare_one_by_one(values: Float32Array, first: int, second: int) -> np.float32:
    """`squared_difference` in Python: where numba is turned off, and for tests."""
    flat = values.reshape(-1)
    steps = flat[int(first) : int(first) + RUN] - flat[int(second) : int(second) + RUN]
    squares = steps * steps
    sums = np.zeros(WIDE, np.float32)
    for start in range(0, RUN - WIDE + 1, WIDE):
        sums += squares[start : start + WIDE]
    sums[-(RUN % WIDE) :] += squares[-(RUN % WIDE) :]
    sums = sums[:4] + sums[4:]
    sums = sums[:2] + sums[2:]
    return np.float32(sums[0] + sums[1])


def compare_runs(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """The instructions of `squared_difference`."""
    values, *places = arguments
    data = context.make_array(signature.args[0])(context, builder, values).data
    total = nothing = ir.Constant(ir.VectorType(ir.FloatType(), WIDE), [0.0] * WIDE)
    for start in [*range(0, RUN - WIDE + 1, WIDE), RUN - WIDE]:
        ours, others = (load(builder, data, builder.add(at, at.type(start)), WIDE) for at in places)
        step = builder.fsub(ours, others)
        square = builder.fmul(step, step)
        if start == RUN - WIDE:  # the numbers that were compared already count as 0
            seen = WIDE - RUN % WIDE
            picked = [*range(WIDE, WIDE + seen), *range(seen, WIDE)]
            square = builder.shuffle_vector(square, nothing, ir.Constant(ir.VectorType(PICKED, WIDE), picked))
        total = builder.fadd(total, square)
    for half in (4, 2):
        lanes = ([*range(half)], [*range(half, 2 * half)])
        lower, upper = (
            builder.shuffle_vector(total, total, ir.Constant(ir.VectorType(PICKED, half), one)) for one in lanes
        )
        total = builder.fadd(lower, upper)
    return builder.fadd(*(builder.extract_element(total, PICKED(number)) for number in range(2)))


@intrinsic
def compare_vectors(typing: Any, values: Any, first: Any, second: Any) -> Any:
    """`squared_difference` for kernels."""
    return types.float32(values, types.uintp, types.uintp), compare_runs


squared_difference: Any = compare_one_by_one if vars(config)["DISABLE_JIT"] else compare_vectors
"""Sum of the squared differences of RUN numbers from two flat places of a contiguous float32 array on, the same bits on every
processor."""
