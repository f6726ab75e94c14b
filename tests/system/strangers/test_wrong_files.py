"""Files of another kind, and words of another form: one short message that says what to do next."""

from __future__ import annotations

import gzip
import io
import shutil
import zipfile
from pathlib import Path

import pytest

from tests.support.analysis.csv_texts import BARE, PLAIN
from tests.support.command import gonio_here
from tests.support.paths import CONFIGS

MOST_LINES = 6


def _archive(*names: str) -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        for name in names:
            archive.writestr(name, "<x/>")
    return content.getvalue()


PAGE = "<!DOCTYPE html>\n<html>\n" + 400 * "<p>a line, and more</p>\n" + "</html>\n"
FILES: dict[str, bytes] = {
    "book.xlsx": _archive("[Content_Types].xml", "xl/workbook.xml"),
    "book.ods": _archive("mimetype application/vnd.oasis.opendocument.spreadsheet"),
    "book.xls": bytes.fromhex("d0cf11e0a1b11ae1") + bytes(100),
    "data.zip": _archive("data.csv"),
    "data.csv.gz": gzip.compress(PLAIN.encode()),
    "page.html": PAGE.encode(),
    "page.csv": b"\xef\xbb\xbf\n " + PAGE.lower().encode(),
    "data.xml": b"<?xml version='1.0'?><data/>",
    "scan.png": b"\x89PNG\r\n\x1a\n" + bytes(20),
    "paper.pdf": b"%PDF-1.7\n",
    "wide.csv": PLAIN.encode("utf-16"),
    "data.json": b'{"brdf": [0.2]}',
    "case.csv": BARE.replace("theta_i_deg", "Theta_I_deg").replace("brdf", "BRDF").encode(),
    "unit.csv": BARE.replace("theta_r_deg", "theta_r (°)").replace("brdf", "brdf [1/sr]").encode(),
    "greek.csv": BARE.replace("theta_i_deg,theta_r_deg,dphi_deg", "θᵢ,θᵣ,Δφ").encode(),
    "u.csv": PLAIN.replace("u_brdf", "U_BRDF").encode(),
    "rad.csv": BARE.replace("theta_i_deg", "theta_i (rad)").encode(),
    "repeats.csv": (BARE + 50 * "30,10,0,0.24\n").encode(),
    "percent.csv": ("theta_i_deg,theta_r_deg,dphi_deg,brdf\n"
                    + "".join(f"30,{n},0,24 %\n" for n in range(80))).encode(),
    "run/record.sqlite": b"SQLite format 3\0" + bytes(84),
    "run/fit.json": b'{"chosen": "lambert", "verdict": "adequate", "candidates": []}\n',
    "run/measurements.csv": PLAIN.encode(),
}  # fmt: skip
PROTOCOL, RIG = CONFIGS / "protocols" / "demo.yaml", CONFIGS / "rigs" / "bench_12bit.yaml"

TABLE = "allowed: a table as text (CSV); "
# Arguments, and the words that the message must hold; the file's own name is always among them.
WRONG: dict[str, tuple[str, ...]] = {
    "fit book.xlsx": ("is an Excel workbook", TABLE, "CSV UTF-8"),
    "fit book.ods": ("is an OpenDocument spreadsheet", TABLE, "CSV UTF-8"),
    "fit book.xls": ("is an old Office file", TABLE, "CSV UTF-8"),
    "fit data.zip": ("is a ZIP archive", TABLE, "unpack it"),
    "fit data.csv.gz": ("is a compressed file", TABLE, "unpack it"),
    "fit page.html": ("is a web page", TABLE, "download the file"),
    "fit page.csv": ("is a web page", TABLE, "download the file"),
    "fit data.xml": ("is an XML file", TABLE, "export"),
    "fit scan.png": ("is a picture (PNG)", TABLE),
    "fit paper.pdf": ("is a PDF", TABLE, "export"),
    "fit wide.csv": ("is text in UTF-16", TABLE, "CSV UTF-8"),
    "fit data.json": ("is a JSON file", TABLE, "a row for each geometry"),
    "fit rig.yaml": ("looks like YAML", "gonio plan"),
    "fit run/fit.json": ("is no table; name the folder of its run, run, or its run/measurements",),
    "fit run/record.sqlite": ("is no table; name the folder of its run, run,",),
    "resume run/record.sqlite": ("is a file of a run; name the run's folder: run",),
    "report run/fit.json": ("is a file of a run; name the run's folder: run",),
    "resume paper.pdf": ("is a file; name the folder of a run",),
    "plan rig.yaml": ("is a rig file (keys beam_length_mm", "allowed: a protocol", "`rig: FILE`"),
    "plan swapped.yaml": ("swapped.yaml:4:6: rig: protocol.yaml:1:1: is a protocol", "a rig file"),
    "plan protocol.yaml --rig protocol.yaml": ("is a protocol (keys rig, sample", "a rig file"),
    "devices --rig protocol.yaml": ("is a protocol (keys rig, sample", "allowed: a rig file"),
    "plan run/fit.json": ("is not a protocol (keys chosen, verdict", "allowed: a protocol"),
    "plan book.xlsx": ("is an Excel workbook; allowed: a YAML file; in . there is",),
    "plan page.html": ("is a web page (HTML); allowed: a YAML file; in . there is",),
    "plan run/record.sqlite": ("is a SQLite database; allowed: a YAML file",),
    "fit case.csv": ("write theta_i_deg for 'Theta_I_deg'; write brdf for 'BRDF'", "allowed"),
    "fit unit.csv": ("write theta_r_deg for 'theta_r (°)'; write brdf for 'brdf [1/sr]'",),
    "fit greek.csv": ("write theta_i_deg for 'θᵢ'; write theta_r_deg for 'θᵣ'; write dphi_deg",),
    "fit u.csv": ("write u_brdf for 'U_BRDF'",),
    "fit rad.csv": ("missing: theta_i_deg; found: theta_i (rad)",),  # a name converts nothing
    "fit repeats.csv": (
        "angles as in line 3",
        "--repeats mean",
        "47 more like repeats.csv:6:1",
    ),
    "fit percent.csv": ("brdf: '24 %' is text", "77 more like percent.csv:4:8"),
    "fit run --models oren_nayer": ("'oren_nayer'", "did you mean oren_nayar?", "known: lambert"),
    "fit run --models Oren-Nayar+ggx": ("'Oren-Nayar'", "did you mean oren_nayar?"),
    "fit run --repeats median": ("--repeats: median; allowed: mean",),
}


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with files of all kinds."""
    folder = tmp_path_factory.mktemp("bench")
    (folder / "run").mkdir()
    for name, content in FILES.items():
        (folder / name).write_bytes(content)
    shutil.copy(PROTOCOL, folder / "protocol.yaml")
    shutil.copy(RIG, folder / "rig.yaml")
    own = PROTOCOL.read_text()
    named = next(line for line in own.splitlines() if line.startswith("rig:"))
    (folder / "swapped.yaml").write_text(own.replace(named, "rig: protocol.yaml"))
    return folder


@pytest.mark.parametrize("arguments", WRONG)
def test_a_wrong_file_or_word_has_one_message_that_says_what_to_do(
    bench: Path, arguments: str
) -> None:
    words = arguments.split()
    done = gonio_here(*words, cwd=bench)
    assert done.returncode == 2, done.stderr
    assert len(done.stderr.splitlines()) <= MOST_LINES
    named = words[1] if "--rig" not in words else words[words.index("--rig") + 1]
    for text in (*WRONG[arguments], *(() if words[2:3] else (named,))):
        assert text in done.stderr
