"""Products in small pieces are those of whole matrices."""

import numpy as np
import pytest

from piezoest.fitting.rows import FEW, gram, onto, times


@pytest.mark.parametrize("count", [0, 1, FEW - 1, FEW, 3 * FEW + 5])
def test_products_of_rows(count: int) -> None:
    rng = np.random.default_rng(count)
    rows, x, w = rng.standard_normal((count, 5)), rng.standard_normal(count), rng.standard_normal(5)
    np.testing.assert_allclose(gram(rows), rows.T @ rows, atol=1e-12)
    np.testing.assert_allclose(onto(rows, x), rows.T @ x, atol=1e-12)
    np.testing.assert_allclose(times(rows, w), rows @ w, atol=1e-12)
