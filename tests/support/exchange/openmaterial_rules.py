"""Rules of OpenMATERIAL 3D for a BRDF look-up table, from its schema 1.1.0 and checker rules."""

from __future__ import annotations

import json
import re
from typing import Any

_UUID = r"[0-9a-fA-F]{8}-[0-9a-fA-F]{4}-[0-9a-fA-F]{4}-[0-9a-fA-F]{4}-[0-9a-fA-F]{12}"
_PATTERNS = {
    "name": ".*",
    "uuid": _UUID,
    "materialVersion": r"\d+\.\d+\.\d+",
    "openMaterial3dVersion": r"\d+\.\d+\.\d+",
    "license": ".*",
    "sources": ".*",
}
_COLUMNS = ((1e-9, 17.16e-3), (0, 1.570796), (0, 1.570796), (0, 6.283185), (0, float("inf")))


def checked(content: bytes) -> dict[str, Any]:
    """Return the file's content; an assertion fails for what the schema does not allow."""
    file: dict[str, Any] = json.loads(content)
    metadata, brdf = file["metadata"], file["brdf"]
    for name, pattern in _PATTERNS.items():
        assert re.fullmatch(pattern, metadata[name]), name
    for name in ("copyrights", "authors"):
        assert metadata[name], name
        assert all(isinstance(text, str) for text in metadata[name])
    assert re.fullmatch(r"\d{8}T\d{6}Z", metadata.get("creationDate", "20260101T000000Z"))
    for angle in brdf.get("receiverSolidAngles", []):
        assert angle["wavelength"] in brdf["wavelengths"]
        assert angle["solidAngle"] > 0
    rows = brdf["lookupTable"]
    for row in rows:
        for value, (low, high) in zip(row, _COLUMNS, strict=True):
            assert value is None or low <= value <= high
        assert row[0] in brdf["wavelengths"]
    assert [row[:4] for row in rows] == sorted(row[:4] for row in rows)
    return file
