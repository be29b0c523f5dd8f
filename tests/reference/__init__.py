"""Textbook versions of the algorithms, written from the sources and independent of the kernels."""

# alpha [1/V], beta [µm/V] and gamma [µm/V²] of the paper's Table I.
TABLE_I = (
    (3.26e-2, 0.136, 5.96e-3), (1.91e-2, 0.149, 4.05e-3), (2.1e-2, 0.147, 4.29e-3), (1.59e-2, 0.155, 3.55e-3),
    (3.32e-2, 0.136, 6.15e-3),
)  # fmt: skip
