"""The code in the documents runs in its order, and their links lead somewhere."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.paths import ROOT

DOCUMENTS = sorted((ROOT / "docs").rglob("*.md"))
NAMES = [str(path.relative_to(ROOT)) for path in DOCUMENTS]
_NEEDED = {"bluesky.md": "bluesky"}  # library of the examples, which not every machine has
_LINK = re.compile(r"\]\((?!https?:)([^)#]+)")
_ROOMS = ("instrument", "drivers", "analysis", "sim", "acquisition", "configs", "tests", "docs")
_PATH = re.compile(rf"`((?:{'|'.join(_ROOMS)})/[\w./]+\.(?:py|yaml|md|csv|svg))`")
_EXAMPLES = re.compile(r"arc(_\w+)?\.py|cosine_lobe\.py")  # added by the documents' examples


def _code(path: Path) -> str:
    return "\n".join(re.findall(r"```python\n(.*?)```", path.read_text(), flags=re.DOTALL))


@pytest.mark.parametrize("path", [p for p in DOCUMENTS if _code(p)], ids=lambda p: p.name)
def test_the_code_of_a_document_runs(path: Path, tmp_path: Path) -> None:
    if path.name in _NEEDED:
        pytest.importorskip(_NEEDED[path.name], reason=f"{_NEEDED[path.name]} is not installed")
    script = tmp_path / "code.py"
    script.write_text(_code(path))
    command = [sys.executable, "-W", "error", str(script)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("path", [*DOCUMENTS, ROOT / "README.md"], ids=lambda p: p.name)
def test_a_link_leads_to_a_file(path: Path) -> None:
    missing = [to for to in _LINK.findall(path.read_text()) if not (path.parent / to).exists()]
    assert not missing


@pytest.mark.parametrize("path", [*DOCUMENTS, ROOT / "README.md"], ids=lambda p: p.name)
def test_a_file_that_a_document_names_exists(path: Path) -> None:
    named = set(_PATH.findall(path.read_text()))
    assert not sorted(n for n in named if not (_EXAMPLES.search(n) or (ROOT / n).exists()))


def test_the_documents_are_the_ones_that_the_readme_lists() -> None:
    readme = (ROOT / "README.md").read_text()
    assert NAMES
    assert not [name for name in NAMES if name not in readme]
