"""Notes: stable codes, each once, as plain values in fit.json."""

from __future__ import annotations

from analysis.choice.choice import choose
from analysis.choice.fit_json import to_json
from analysis.choice.notes import Note, NoteCode
from analysis.data.measurements import Measurements


def test_the_codes_are_words_that_scripts_can_use() -> None:
    """A code that scripts may know must not change: this list only grows."""
    assert {str(code) for code in NoteCode} >= {
        "u_not_stated", "u_too_small", "u_too_large", "wide_range", "outliers",
        "simpler_preferred", "few_points", "outside_validity", "relative_values", "search_end",
    }  # fmt: skip
    assert Note(NoteCode.CUT, "words").json == {"code": "cut", "text": "words"}


def test_notes_stand_in_the_json() -> None:
    found = choose(Measurements.bare(30, [0, 20, 40, 60], 0, [0.2, 0.21, 0.19, 0.2]))
    codes = [note["code"] for note in to_json(found)["notes"]]
    assert codes == ["u_not_stated", "search_end"] or "few_points" in codes
    assert len(set(codes)) == len(codes)
