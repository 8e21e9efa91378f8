from __future__ import annotations

from math import inf, isnan, nan

import pytest

from yumi.control.trajectory import excess


def test_polynomial_inside_of_its_range_has_no_excess() -> None:
    assert excess((0.0, 1.0, 0.0), 1.0, -1.0, 1.0) is None


def test_polynomial_outside_of_its_range_is_farthest_out_somewhere() -> None:
    out = excess((0.0, 0.0, 3.0), 1.0, -1.0, 1.0)
    assert out is not None
    assert (out.time, out.value) == (1.0, 3.0)


@pytest.mark.parametrize("polynomial", [(nan, 0.0), (0.0, inf), (0.0, nan, 1.0), (0.0, 1e308, 1e308, -1e308)])
def test_polynomial_that_cannot_be_calculated_with_is_nowhere_inside(polynomial: tuple[float, ...]) -> None:
    out = excess(polynomial, 10.0, -1e300, 1e300)
    assert out is not None
    assert isnan(out.value)
