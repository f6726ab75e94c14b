"""Printing of a report to a PDF file by a Chromium that is installed."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from instrument.errors import InputError, StorageError
from instrument.text.atomic_file import write_whole

# Names under which distributions install it; https://www.chromium.org calls all of them Chromium.
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
_PRINT_S = 120.0  # a report prints in two seconds
_QUIET = ("--headless", "--disable-gpu", "--no-first-run", "--disable-background-networking")


def browser() -> str:
    """Return the path of an installed browser; raises `InputError` without one."""
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        raise InputError(
            f"--pdf: no Chromium is installed ({', '.join(BROWSERS)}): install one, or print "
            "report.html from any browser"
        )
    return found


def print_pdf(page: Path, browser: str) -> Path:
    """Print an HTML page that needs nothing from elsewhere; return the PDF file beside it.

    Raises `StorageError` where it fails.
    """
    with tempfile.TemporaryDirectory(prefix="gonio-pdf-") as folder:
        printed = Path(folder) / "report.pdf"
        said = _run(browser, page, printed, Path(folder))
        if not printed.is_file() or not printed.stat().st_size:
            raise StorageError(
                f"{page}: {browser} printed nothing: {said or 'it does not say why'}; print the "
                "page from any browser"
            )
        target = page.with_suffix(".pdf")
        write_whole(target, printed.read_bytes())
    return target


def _run(browser: str, page: Path, printed: Path, folder: Path) -> str:
    """Run the browser and return the last line that it said, empty without one."""
    # Chromium refuses to run as root in its sandbox; the page and its script are the program's own.
    as_root = ["--no-sandbox"] if os.geteuid() == 0 else []
    command = [
        browser, *_QUIET, *as_root, f"--user-data-dir={folder / 'profile'}",
        "--no-pdf-header-footer", f"--print-to-pdf={printed}", page.resolve().as_uri(),
    ]  # fmt: skip
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, errors="replace", timeout=_PRINT_S,
            check=False, stdin=subprocess.DEVNULL,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return f"not finished within {_PRINT_S:g} s"
    except OSError as error:
        return str(error)
    return done.stderr.strip().rpartition("\n")[2][:200]
