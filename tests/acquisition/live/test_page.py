"""Files of the live page: whole, packaged, of this project, and fit for its security policy."""

from __future__ import annotations

import hashlib
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

from acquisition.interlocks import doubt, frame_scatter, lamp_checks, no_light
from acquisition.measure import radiometry, stray_light
from tests.support.paths import ROOT

LIVE = ROOT / "acquisition" / "live"
PAGE, VENDOR = LIVE / "page", LIVE / "vendor"
HTML = (PAGE / "index.html").read_text()
NAMESPACE = "http://www.w3.org/2000/svg"


def _scripts() -> list[Path]:
    found = sorted((PAGE / "scripts").rglob("*.js"))
    assert found
    return found


def test_every_file_of_the_page_is_packaged() -> None:
    with (ROOT / "pyproject.toml").open("rb") as file:
        forms = tomllib.load(file)["tool"]["setuptools"]["package-data"]["acquisition.live"]
    packed = {path for form in forms for path in LIVE.glob(form) if path.is_file()}
    needed = {p for folder in (PAGE, VENDOR) for p in folder.rglob("*") if p.is_file()}
    assert needed <= packed


def test_the_page_refers_to_files_that_are_there() -> None:
    named = re.findall(r'(?:href|src)="/static/([^"]+)"', HTML)
    assert len(named) > 5
    assert not [name for name in named if not any((top / name).is_file() for top in (PAGE, VENDOR))]


def test_every_imported_module_is_there_and_every_module_is_imported() -> None:
    imported = {PAGE / "scripts" / "main.js"}
    for script in _scripts():
        for name in re.findall(
            r"^import .*from '(\./[^']+|\.\./[^']+)';", script.read_text(), re.M
        ):
            imported.add((script.parent / name).resolve())
    assert imported == set(_scripts())


def test_every_element_that_a_script_asks_for_is_on_the_page_or_made_by_one() -> None:
    texts = [script.read_text() for script in _scripts()]
    asked = {i for t in texts for i in re.findall(r"\b(?:by|write|show)\('([\w-]+)'", t)}
    made = {i for t in texts for i in re.findall(r"\bid[:=] ?'([\w-]+)'", t)}
    there = set(re.findall(r'\bid="([\w-]+)"', HTML))
    levels = {
        f"{name}-level" for t in texts for name in re.findall(r"\b(?:bar|level)\('([\w-]+)'", t)
    }
    assert len(asked) > 20
    assert not asked - there - made - levels


def test_nothing_is_inline_and_nothing_comes_from_elsewhere() -> None:
    """The policy of the server forbids both; a browser would only leave them out."""
    assert not re.search(r"<style|\sstyle=|\son\w+=|<script(?![^>]*\ssrc=)|data:", HTML)
    for path in [PAGE / "index.html", *_scripts(), *_styles()]:
        text = path.read_text().replace(NAMESPACE, "")
        assert not re.search(r"https?:|//\w+\.\w|@import|\beval\(|innerHTML|data:image", text), path


def _styles() -> Iterator[Path]:
    return (PAGE / "styles").glob("*.css")


def test_scripts_are_short_and_say_what_they_are() -> None:
    for script in _scripts():
        lines = script.read_text().splitlines()
        assert lines[0].startswith("// "), script
        assert len(lines) < 150, script


def test_vendored_files_are_those_whose_digest_is_noted() -> None:
    for folder in VENDOR.iterdir():
        noted = dict(
            reversed(line.split())
            for line in (folder / "README.md").read_text().splitlines()
            if re.match(r"[0-9a-f]{64} ", line)
        )
        found = {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in folder.iterdir()}
        assert noted
        assert {name: found[name] for name in noted} == noted
        assert set(found) == {*noted, "README.md", "LICENSE"}


def test_every_flag_of_a_reading_has_words() -> None:
    flags = {
        "saturated", "hot pixels", "dead pixels", radiometry.LEAVES_FRAME, radiometry.FEW_PIXELS,
        stray_light.LEAVES, stray_light.BRIGHT, frame_scatter.FLAG, doubt.DOUBTED,
        no_light.NO_SIGNAL, lamp_checks.UNPROVEN, lamp_checks.STOPPED,
    }  # fmt: skip
    text = (PAGE / "scripts" / "words.js").read_text()
    table = text.partition("const FLAGS = {")[2].partition("\n};")[0]
    assert set(re.findall(r"^  '?([\w ]+?)'?: \[", table, re.M)) == flags
