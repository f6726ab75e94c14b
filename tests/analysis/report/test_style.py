"""Style of the report: numbers rounded to their uncertainty."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from analysis.report.style import format_value
from tests.support.analysis.report_data import NAN

# 0, and every magnitude from 1e-300 to 1e300 alike.
WIDE = st.just(0.0) | st.floats(-300.0, 300.0).map(lambda power: 10.0**power)


class TestFormatValue:
    @pytest.mark.parametrize(
        ("value", "u", "unit", "expected"),
        [
            (20.01311, 0.0213, "°", "20.013 ± 0.021\u00a0°"),
            (20.01311, 0.0996, "", "20.01 ± 0.10"),  # rounding up adds a digit
            (0.9, 0.25, "", "0.90 ± 0.25"),
            (12346.0, 123.0, "mm", "12350 ± 120\u00a0mm"),
            (-1.0, 3.0, "", "-1.0 ± 3.0"),
            (1.2346e-9, 2.1e-11, "", "(1.235 ± 0.021)\u00a0×\u00a010⁻⁹"),
            (4.2e9, 1.0e8, "", "(4.20 ± 0.10)\u00a0×\u00a010⁹"),
            (0.0, 1.0e-9, "", "(0.0 ± 1.0)\u00a0×\u00a010⁻⁹"),
            (1.5, 1.0e-9, "", "1.5000000000 ± 0.0000000010"),
            (0.0151, 1.1e-9, "", "0.0151000000 ± 0.0000000011"),
            (3.0e7, 1.0e-3, "", "(3.00000000000 ± 0.00000000010)\u00a0×\u00a010⁷"),
            (-1e-20, 1.0, "", "0.0 ± 1.0"),
            (1e-300, 1e300, "", "(0.0 ± 1.0)\u00a0×\u00a010³⁰⁰"),
            # The digits that u would leave are more than a float holds.
            (1.5, 1e-15, "", "1.5 ± 1\u00a0×\u00a010⁻¹⁵"),
            (-1e300, 1e-300, "", "-1\u00a0×\u00a010³⁰⁰ ± 1\u00a0×\u00a010⁻³⁰⁰"),
            (1.2346e-9, None, "", "1.235\u00a0×\u00a010⁻⁹"),
            (20.01311, None, "°", "20.01\u00a0°"),
            (20.01311, 0.0, "", "20.01"),
            (20.01311, NAN, "", "20.01"),
            (20.01311, np.inf, "", "20.01"),
            (NAN, 0.1, "°", "—"),
            (np.inf, None, "", "—"),
        ],
    )
    def test_two_digits_of_the_uncertainty(
        self, value: float, u: float | None, unit: str, expected: str
    ) -> None:
        assert format_value(value, u, unit) == expected

    @given(value=WIDE | WIDE.map(lambda x: -x), u=WIDE)
    @example(value=9.99999999999999999, u=9.96)
    @example(value=1e300, u=1e-300)
    @example(value=1.0, u=9.96e-10)
    @example(value=0.0, u=5e-324)
    def test_any_finite_number_is_printed_and_reads_back_as_itself(
        self, value: float, u: float
    ) -> None:
        text = format_value(value, u, "")
        if u == 0:
            assert _read(text) == pytest.approx(value, rel=5.1e-4, abs=0.0)
            return
        shared = re.fullmatch(r"\((.*) ± (.*)\)(\u00a0×\u00a010.*)", text)
        number, uncertainty = (
            (shared[1] + shared[3], shared[2] + shared[3]) if shared else text.split(" ± ")
        )
        assert _read(uncertainty) == pytest.approx(u, rel=0.0501, abs=0.0)
        assert abs(_read(number) - value) <= 0.0501 * u + 1e-14 * abs(value)
        assert len(text) < 60


def _read(text: str) -> float:
    """Number from its printed form, with a power of ten or without."""
    mantissa, _, power = text.partition("\u00a0×\u00a010")
    ascii_power = power.translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789"))
    return float(f"{mantissa}e{ascii_power or 0}")
