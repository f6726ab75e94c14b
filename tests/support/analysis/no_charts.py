"""Reports without pictures: drawing takes more than half of the time of a small run."""

from __future__ import annotations

import pytest

WITHOUT_CHARTS = (
    "from tests.support.analysis.no_charts import leave_charts_out; leave_charts_out(); "
    "from acquisition.entry import main; main()"
)
"""Program, for `python -c`, that does what `python -m acquisition` does, without charts."""


def leave_charts_out(patch: pytest.MonkeyPatch | None = None) -> None:
    """Leave empty the charts of the reports of this process, until `patch` is undone."""
    patch = patch or pytest.MonkeyPatch()
    patch.setattr("analysis.report.figure_list.embedded_svg", lambda *_: "<svg></svg>")
    patch.setattr("analysis.report.page.rendered_html", lambda *_: "")
