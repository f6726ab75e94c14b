"""Whatever stands in the files: a result or an `InputError`, never anything else."""

from pathlib import Path

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from test_config_load import PROTOCOL, RIG, check_model

from instrument.config import load_protocol
from instrument.errors import InputError


def _result_or_input_error(folder: Path, protocol: str, rig: str) -> None:
    path, rig_path = folder / "p.yaml", folder / "r.yaml"
    path.write_text(protocol, encoding="utf-8")
    rig_path.write_text(rig, encoding="utf-8")
    found = None
    try:
        load_protocol(path, rig_path, check_model=check_model)
    except InputError as error:
        found = error.problems
    if found is None:
        return
    assert found
    assert all(p.startswith((f"{path}:", f"{rig_path}:")) for p in found)
    assert all(p.encode("utf-8") for p in found)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fuzz")


_SCALARS = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.sampled_from(
        ["hand", "simulated", "5e-3", "1:30", "", "rig.yaml", "<list>", "\x00", "\ud800"]
    ),
)
_KEYS = st.sampled_from(
    [
        *["name", "theta_i_deg", "dphi_deg", "theta_r_deg", "start", "stop", "num", "width_mm"],
        *["camera_to_lamp_deg", "white_tile", "parameters", "theta_i", "driver", "<steps>"],
    ]
)
_DATA = st.recursive(
    _SCALARS,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(_KEYS, inner, max_size=5),
    max_leaves=12,
)


@settings(max_examples=150, deadline=None)
@given(data=_DATA, where=st.sampled_from(["protocol", "rig"]), at=st.integers(0, 20))
def test_any_data_in_any_section_gives_a_result_or_an_input_error(
    folder: Path, data: object, where: str, at: int
) -> None:
    texts = {"protocol": PROTOCOL, "rig": RIG}
    content = yaml.safe_load(texts[where])
    content[list(content)[at % len(content)]] = data
    texts[where] = yaml.safe_dump(content)
    _result_or_input_error(folder, texts["protocol"], texts["rig"])


@settings(max_examples=150, deadline=None)
@given(cut=st.integers(0, len(PROTOCOL)), length=st.integers(0, 30), new=st.text(max_size=8))
def test_any_damage_to_the_text_gives_a_result_or_an_input_error(
    folder: Path, cut: int, length: int, new: str
) -> None:
    _result_or_input_error(folder, PROTOCOL[:cut] + new + PROTOCOL[cut + length :], RIG)
