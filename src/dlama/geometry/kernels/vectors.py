"""Numbers of a picture and two places in them in; how much the runs from there on differ out, several numbers in one register.

numba computes such sums one number at a time, which takes twice as long; so LLVM's vectors are written out here.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import config, types
from numba.extending import intrinsic

from dlama.geometry.rgbd import Float32Array

PICKED = ir.IntType(32)
"""Type of the number of a place in a vector."""
WIDE, RUN = 8, 35
"""Numbers of a vector, and in all, that `squared_difference` compares."""


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
    vector = ir.VectorType(ir.FloatType(), WIDE)
    total = nothing = ir.Constant(vector, [0.0] * WIDE)
    for start in [*range(0, RUN - WIDE + 1, WIDE), RUN - WIDE]:
        runs = (builder.gep(data, [builder.add(at, at.type(start))]) for at in places)
        ours, others = (builder.load(builder.bitcast(run, vector.as_pointer()), align=4) for run in runs)
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
