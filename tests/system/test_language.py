"""Language of the house: how docstrings open, and what array functions say of their arguments."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator

from tests.support.paths import ROOT

PACKAGES = ("instrument", "drivers", "analysis", "sim", "acquisition")

# A docstring opens with the noun or verb that it is about.
QUESTION = re.compile(r"(What|Where|How|Whether|Who|Which|When|Is|Are|Does)\b")

ARRAY = re.compile(
    r"FloatArray|IntArray|BoolArray|NDArray|ArrayLike|\bImage\b|\bGeometry\b|\bBrdf\b"
)
# `(N,)`, `(rows, columns)`, `(...)`, words for shapes, or the reference to the one full docstring.
SHAPE = re.compile(
    r"\(\.\.\.[,)]|\(\w+,\)|\((?:[\w.]+, )+[\w.]+\)|\bshapes?\b|\bscalars?\b|\bbroadcast"
    r"|Model\.brdf|Model\.gradient"
)
UNIT = re.compile(
    r"°|%|1/sr|\b(?:deg|degrees?|rad|radians?|sr|DN|s|seconds?|mm|px|pixels?|nm|counts?|units?)\b"
    r"|_(?:deg|rad|mm|px|dn|s|per_sr)\b|electrons|\brelative\b|wavelength|dimensionless|probabilit"
    r"|\bratio\b|\bind(?:ex|ices)\b|\bcosines?\b|\bfraction\b|\b0 (?:to|and|or) 1\b|boolean"
    r"|\bmask\b|\bTrue\b|Model\.brdf|Model\.gradient"
)


def _modules() -> Iterator[tuple[str, ast.Module]]:
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            yield str(path.relative_to(ROOT)), ast.parse(path.read_text())


def _public(tree: ast.Module) -> Iterator[ast.ClassDef | ast.FunctionDef]:
    """Public classes, functions and methods of public classes."""
    for node in tree.body:
        if isinstance(node, ast.ClassDef | ast.FunctionDef) and not node.name.startswith("_"):
            yield node
            for method in node.body if isinstance(node, ast.ClassDef) else []:
                if isinstance(method, ast.FunctionDef) and not method.name.startswith("_"):
                    yield method


def _array_functions(tree: ast.Module) -> Iterator[ast.FunctionDef]:
    for node in _public(tree):
        if isinstance(node, ast.FunctionDef):
            arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
            annotations = [a.annotation for a in arguments if a.annotation] + [
                node.returns or ast.Constant("")
            ]
            if any(ARRAY.search(ast.unparse(annotation)) for annotation in annotations):
                yield node


def test_every_room_and_module_says_what_it_is() -> None:
    silent = [name for name, tree in _modules() if not ast.get_docstring(tree)]
    assert not silent


def test_docstrings_open_with_the_thing_they_describe() -> None:
    riddles = [
        f"{name}: {ast.get_docstring(node)}"
        for name, tree in _modules()
        for node in (tree, *_public(tree))
        if QUESTION.match(ast.get_docstring(node) or "")
    ]
    assert not riddles


def test_array_functions_state_shape_and_unit() -> None:
    missing = [
        f"{name}:{node.lineno}: {node.name} states no {what}"
        for name, tree in _modules()
        for node in _array_functions(tree)
        for what, pattern in (("shape", SHAPE), ("unit", UNIT))
        if not pattern.search(ast.get_docstring(node) or "")
    ]
    assert not missing
