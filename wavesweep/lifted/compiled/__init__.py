"""Connection and lifting by a compiled kernel: the steps of `tape` and `lift`, loop by loop.

This package loads numba, which is an optional extra, and nothing imports it unless the kernel is chosen (`wavesweep.kernel`).
"""
