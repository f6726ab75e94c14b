"""Written protocol of chosen geometries: it loads, from any folder, and plans the same."""

from __future__ import annotations

from pathlib import Path

import pytest

from acquisition.design.geometries import quicker
from acquisition.design.protocol_file import protocol_text
from acquisition.plan.plan import make_plan
from acquisition.results.model_check import check_model
from instrument.config.load import load_protocol
from tests.support.paths import CONFIGS

PROTOCOLS = sorted((CONFIGS / "protocols").glob("*.yaml"))
FEW = {(45.0, 0.0): [-62.3333, 10.5, 70.0], (60.0, 0.0): [0.0, 12.25]}


@pytest.mark.parametrize("path", PROTOCOLS, ids=lambda path: path.stem)
def test_a_written_protocol_plans_the_chosen_geometries(path: Path, tmp_path: Path) -> None:
    loaded = load_protocol(path)
    chosen, plan = quicker(loaded, FEW)
    folder = tmp_path / "new"
    folder.mkdir()
    file = folder / "few.yaml"
    file.write_text(protocol_text(chosen, folder, ["first\nline", "second"]))
    again = load_protocol(file, check_model=check_model)
    assert make_plan(again) == plan
    same = {"name", "rig", "sweeps"}
    assert again.protocol.model_dump(exclude=same) == loaded.protocol.model_dump(exclude=same)
    assert again.rig == loaded.rig


def test_the_table_of_the_white_tile_is_found_from_another_folder(tmp_path: Path) -> None:
    text = (CONFIGS / "protocols" / "demo.yaml").read_text()
    old, new = tmp_path / "old", tmp_path / "new"
    for folder in (old, new):
        folder.mkdir()
    text = text.replace("../rigs/bench_12bit.yaml", str(old / "rig.yaml"))
    text = text.replace("reflectance: 0.99, u_reflectance: 0.005", "table: tile.csv")
    rig = (CONFIGS / "rigs" / "bench_12bit.yaml").read_text()
    tile = "  tile: {at_normal: 1.0, falloff: 0.1, forward: 0.1}\n"
    (old / "rig.yaml").write_text(rig.rstrip("\n") + "\n" + tile)
    rows = [f"{i},10,0,0.98,0.01" for i in (0, 30, 45, 60, 75)]
    header = "theta_i_deg,theta_r_deg,dphi_deg,beta,u_beta"
    (old / "tile.csv").write_text("\n".join([header, *rows]) + "\n")
    (old / "scan.yaml").write_text(text)
    chosen, plan = quicker(load_protocol(old / "scan.yaml"), FEW)
    (new / "few.yaml").write_text(protocol_text(chosen, new, []))
    again = load_protocol(new / "few.yaml")
    assert make_plan(again) == plan
    assert again.tile_text == chosen.tile_text
