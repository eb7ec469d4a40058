"""The equations, each once, as scalar arithmetic on records that carry the paper's names.

The bottom room: it knows nothing of descriptions, arms or files. A kernel takes numbers, arrays
and records (rows of structured arrays) and uses arithmetic, comparisons, ``if``, ``for``,
``while``, indexing, slices of rows, ``min``, ``max``, ``abs``, ``int``, a few functions of `math`,
and other kernels: the part of Python that is also C and JavaScript. `compiled.kernel` compiles it.

Importing a module of this room loads numba. The rest of the package does so where a law, an
operator or a simulation starts, so that ``import fpid_pin`` stays light.
"""
