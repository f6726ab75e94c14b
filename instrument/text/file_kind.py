"""Kind of a file by its first bytes: a workbook, a web page or a picture is no text to read."""

from __future__ import annotations

import re
from typing import NamedTuple


class FileKind(NamedTuple):
    """Name of a kind of file, with its article, and how to get a table of text from it."""

    name: str
    advice: str


_SHEET = 'save its sheet as "CSV UTF-8 (comma delimited)"'
_WORKBOOK = FileKind("an Excel workbook", _SHEET)
_WEB_PAGE = FileKind("a web page (HTML)", "download the file that it links to, not the page")
_RECORD = FileKind("a SQLite database", "of a run, name the folder")
_UTF_16 = FileKind("text in UTF-16", 'save it as "CSV UTF-8", or as UTF-8 in an editor')
_PICTURE = "name a table of the values that it shows"
_EXPORT = "export its table as CSV in the program that wrote it"

# First bytes of a format ("magic numbers"): file(1), and the formats' own specifications.
_BEGINNINGS = {
    b"SQLite format 3\0": _RECORD,
    b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1": FileKind("an old Office file (.xls, .doc)", _SHEET),
    b"%PDF-": FileKind("a PDF", _EXPORT),
    b"\x89PNG\r\n\x1a\n": FileKind("a picture (PNG)", _PICTURE),
    b"\xff\xd8\xff": FileKind("a picture (JPEG)", _PICTURE),
    b"II*\0": FileKind("a picture (TIFF)", _PICTURE),
    b"MM\0*": FileKind("a picture (TIFF)", _PICTURE),
    b"\x1f\x8b": FileKind("a compressed file (gzip)", "unpack it first"),
    b"\x89HDF\r\n\x1a\n": FileKind("an HDF5 file", _EXPORT),
    b"MATLAB 5.0 MAT-file": FileKind("a MATLAB file", _EXPORT),
    b"\x93NUMPY": FileKind("a NumPy array", _EXPORT),
    b"\xff\xfe": _UTF_16,
    b"\xfe\xff": _UTF_16,
}
_ZIP = b"PK\x03\x04"
_ARCHIVE = FileKind("a ZIP archive", "unpack it first")
_OPEN_DOCUMENT = FileKind("an OpenDocument spreadsheet", _SHEET)
_HTML = re.compile(rb"<(!doctype\s+html|html|head|body)\b", re.IGNORECASE)
_XML = FileKind("an XML file", _EXPORT)
_SEARCHED = 64 * 1024  # bytes in which the names of a ZIP's members are looked for


def foreign_kind(raw: bytes) -> FileKind | None:
    """Return the kind of a file that is no plain UTF-8 table or YAML text, None for others.

    JSON is no kind of its own here: YAML contains it, and a table's first name may begin like it.
    """
    for beginning, kind in _BEGINNINGS.items():
        if raw.startswith(beginning):
            return kind
    if raw.startswith(_ZIP):
        return _kind_of_archive(raw[:_SEARCHED])
    text = _beginning_of_text(raw)
    if _HTML.match(text):
        return _WEB_PAGE
    if text.startswith(b"<?xml"):
        return _WEB_PAGE if _HTML.search(text) else _XML
    return None


def _kind_of_archive(raw: bytes) -> FileKind:
    if b"xl/" in raw or b"[Content_Types].xml" in raw:
        return _WORKBOOK
    return _OPEN_DOCUMENT if b"opendocument.spreadsheet" in raw else _ARCHIVE


def _beginning_of_text(raw: bytes) -> bytes:
    return raw[:1024].removeprefix(b"\xef\xbb\xbf").lstrip()
