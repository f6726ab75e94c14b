"""Fuzzed files: the readers return a result or raise an `InputError` with the position.

Valid files are mutated byte by byte and, for YAML, value by value. Each error has the promised form
and is safe for a terminal, and no input takes long or leaks memory.
"""

from __future__ import annotations

import random
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml

from analysis.data.csv.table import read_table
from analysis.data.curet import read_curet
from instrument.config.load import load_protocol, load_rig
from instrument.errors import InputError
from instrument.text.terminal_safe import first_unfit
from tests.support.analysis.csv_texts import BARE, PLAIN
from tests.support.analysis.curet_texts import TABLE, VALUES
from tests.support.command import gonio_here as gonio
from tests.support.config.texts import PROTOCOL, RIG, check_model
from tests.support.paths import CONFIGS
from tests.support.strangers.mutations import Mutator, feed

# As `gonio run` writes it; shortened to two points and two of the columns behind the promised ones.
RUN_CSV = (
    "theta_i_deg,theta_r_deg,dphi_deg,radiance,u_radiance,brdf,u_brdf,window_pixels,exposure_s,"
    "frames,flags,time_utc,u_photon_and_read_noise_relative,u_lamp_drift_relative\n"
    "30.0,-80.0,0.0,60123.4567,81.2,0.231234567,0.00129,31000.25,0.032,4,,"
    "2026-01-01T00:00:12+00:00,0.000113,0.0002\n"
    "30.0,-75.0,0.0,60223.1,80.4,0.232,0.0013,30999.5,0.032,4,saturated; too few pixels,"
    "2026-01-01T00:00:13+00:00,0.000111,0.0002\n"
)
YAML_WORDS = (
    b"!!python/object/apply:os.system [ls]", b"!!binary aGk=", b"&a ", b"*a", b"<<: ", b"? ",
    b": ", b"- ", b"{", b"}", b"[", b"[" * 50, b"|\n", b">\n", b"'", b'"', b'"\\x1b[2J"',
    b'"\\ud800"', b"---\n", b"%YAML 9.9\n", b"#", b"true", b"null", b"~", b"2024-01-01", b"@",
    b'"\\U00110000"', b"a: " * 20, b"x" * 3000,
)  # fmt: skip
CSV_WORDS = (b",", b'"', b'""', b";", b"#", b"," * 1500, b"x" * 5000, b'"' * 99)
_PLACE = re.compile(r":[0-9]+:[0-9]+: ")


def _said(error: InputError, *names: object) -> tuple[str, ...]:
    """Return the lines of an error, each of which names its file and is safe for a terminal."""
    problems = error.problems
    assert problems
    for line in problems:
        assert line.startswith((*map(str, names), "... and "))
        assert first_unfit(line) is None
        assert len(line.encode()) < 4000
    return problems


def shipped(*folders: str) -> list[bytes]:
    paths = [path for folder in folders for path in sorted((CONFIGS / folder).glob("*.yaml"))]
    return [path.read_bytes() for path in paths]


def _in_other_form(rng: random.Random, text: bytes) -> bytes:
    """Return a YAML file with one value replaced, removed or moved."""
    data = yaml.load(text, getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    parents = list(_blocks(data))
    parent, other = rng.choice(parents), rng.choice(parents)
    keys = list(parent) if isinstance(parent, dict) else list(range(len(parent)))
    key = rng.choice(keys)
    values = [None, True, -1, 0, 10**30, 1e308, float("nan"), float("-inf"), "", "x", [], {}, [[]]]
    if rng.random() < 0.2:
        del parent[key]
    elif rng.random() < 0.2 and isinstance(parent, dict):
        parent[rng.choice(("driver", "<list>", "x y", "5", "name"))] = parent[key]
    else:
        parent[key] = rng.choice([*values, yaml.safe_load(yaml.safe_dump(other))])
    return str(yaml.dump(data, Dumper=getattr(yaml, "CSafeDumper", yaml.SafeDumper))).encode()


def _blocks(data: object) -> list[dict[object, object] | list[object]]:
    inner = data.values() if isinstance(data, dict) else data if isinstance(data, list) else ()
    own = [data] if isinstance(data, dict | list) and data else []
    return [*own, *(block for value in inner for block in _blocks(value))]


class YamlMutator(Mutator):
    """Mutator of which every other input is valid YAML with wrong values."""

    def __call__(self, number: int) -> bytes:
        rng = random.Random(self.seed * 7_000_003 + number)
        example = rng.choice(self.examples)
        return _in_other_form(rng, example) if number % 2 else self.spoil(rng, example)


@pytest.mark.slow
def test_a_fuzzed_protocol_is_read_or_refused_with_its_position(slow: bool, tmp_path: Path) -> None:
    path, rig = tmp_path / "p.yaml", tmp_path / "rig.yaml"
    rig.write_text(RIG)

    def read(data: bytes) -> None:
        path.write_bytes(data)
        try:
            loaded = load_protocol(path, rig, check_model=check_model)
        except InputError as error:
            for line in _said(error, path, rig):
                assert _PLACE.match(line.removeprefix(str(path)).removeprefix(str(rig)))
        else:
            assert first_unfit(loaded.protocol.name + loaded.protocol.sample.name) is None

    examples = [PROTOCOL.encode(), *shipped("protocols")]
    feed(YamlMutator(examples, 1, YAML_WORDS), 10_000 if slow else 40, read)


@pytest.mark.slow
def test_a_fuzzed_rig_is_read_or_refused_with_its_position(slow: bool, tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"

    def read(data: bytes) -> None:
        path.write_bytes(data)
        try:
            load_rig(path)
        except InputError as error:
            for line in _said(error, path):
                assert _PLACE.match(line.removeprefix(str(path)))

    examples = [RIG.encode(), *shipped("rigs")]
    feed(YamlMutator(examples, 2, YAML_WORDS), 10_000 if slow else 40, read)


@pytest.mark.slow
def test_a_fuzzed_table_is_read_or_refused_with_its_position(slow: bool, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"

    def read(data: bytes) -> None:
        path.write_bytes(data)
        try:
            table = read_table(path)
        except InputError as error:
            _said(error, path)
            return
        m = table.measurements
        assert m.size + table.flagged > 0
        assert np.all(np.isfinite([m.theta_i_deg, m.theta_r_deg, m.dphi_deg, m.brdf]))
        assert m.u_random is None or np.all(m.u_random > 0)

    examples = [text.encode() for text in (PLAIN, BARE, RUN_CSV)]
    feed(Mutator(examples, 3, CSV_WORDS), 10_000 if slow else 300, read)


@pytest.mark.slow
def test_fuzzed_curet_tables_are_read_or_refused_with_their_position(
    slow: bool, tmp_path: Path
) -> None:
    paths = tmp_path / "table.txt", tmp_path / "abrdf.dat"
    examples = TABLE.encode(), VALUES.encode()
    for path, text in zip(paths, examples, strict=True):
        path.write_bytes(text)

    def of(which: int) -> Callable[[bytes], None]:
        def read(data: bytes) -> None:
            paths[which].write_bytes(data)
            try:
                curet = read_curet(tmp_path, 1)
            except InputError as error:
                _said(error, *paths)
                return
            assert np.all(curet.measurements.brdf > 0)

        return read

    for which in (0, 1):
        feed(Mutator(examples, 4 + which, CSV_WORDS), 5_000 if slow else 250, of(which))
        paths[which].write_bytes(examples[which])


HOSTILE = {
    "p.yaml": b"name: !!python/object/apply:os.system ['touch executed']\n" + PROTOCOL.encode(),
    "deep.yaml": b"a: " + b"[" * 100_000,
    "a.csv": RUN_CSV.encode("utf-16"),
    "numbers.csv": BARE.encode() + b"30,20,0,9e999\n30,30,0,\x1b[2J\n",
}


@pytest.mark.parametrize("name", HOSTILE)
def test_the_command_refuses_hostile_files_with_exit_code_2(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_bytes(HOSTILE[name])
    done = gonio("plan" if name.endswith(".yaml") else "fit", path)
    assert done.returncode == 2
    assert done.stdout == ""
    assert _PLACE.match(done.stderr.removeprefix(str(path)))
    assert "Traceback" not in done.stderr
    assert first_unfit(done.stderr) is None
    assert not (CONFIGS.parent / "executed").exists()
