"""Style of the report: numbers rounded to their uncertainty."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.report.style import format_value
from tests.support.analysis.report_data import NAN


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
