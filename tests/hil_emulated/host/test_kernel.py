"""The kernel of the emulated computer: found, with its modules in an order that loads."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.hil_emulated.host.kernel import Kernel, installed_kernel


def write_kernel(
    root: Path, version: str, needs: dict[str, list[str]], built_in: tuple[str, ...] = ()
) -> Kernel:
    """Write image, modules.dep (a module's needs, and theirs, on its line) and modules.builtin."""
    modules = root / "modules" / version
    modules.mkdir(parents=True)
    (root / "boot").mkdir(exist_ok=True)
    image = root / "boot" / f"vmlinuz-{version}"
    image.write_bytes(b"")

    def file(name: str) -> str:
        return f"kernel/drivers/{name.replace('_', '-')}.ko.xz"

    lines = [f"{file(name)}: {' '.join(map(file, needed))}" for name, needed in needs.items()]
    (modules / "modules.dep").write_text("\n".join(lines) + "\n")
    (modules / "modules.builtin").write_text("\n".join(f"kernel/{n}.ko" for n in built_in))
    return Kernel(version, image, modules)


def everything() -> dict[str, list[str]]:
    """Every module that is wanted, none of which needs another."""
    names = (
        "virtio_pci", "virtio_net", "9p", "9pnet_virtio", "overlay", "xhci_pci",
        "uvcvideo", "vhci_hcd", "cdc_acm", "ftdi_sio", "vivid",
    )  # fmt: skip
    return {name: [] for name in names}


@given(st.integers(2, 12).flatmap(lambda n: st.lists(
    st.sets(st.integers(0, n - 1)), min_size=n, max_size=n)))  # fmt: skip
def test_a_module_is_loaded_after_those_that_it_needs(
    tmp_path_factory: pytest.TempPathFactory, graph: list[set[int]]
) -> None:
    needs = {f"m_{i}": [f"m_{j}" for j in sorted(js) if j < i] for i, js in enumerate(graph)}
    kernel = write_kernel(tmp_path_factory.mktemp("kernel"), "6.1.0-1-amd64", needs)
    last = f"m_{len(graph) - 1}"
    order = [p.name.split(".")[0].replace("-", "_") for p in kernel.load_order((last,))]
    assert order[-1] == last
    assert len(set(order)) == len(order)
    assert all(set(needs[name]) <= set(order[:place]) for place, name in enumerate(order))


def test_what_is_built_in_is_not_loaded(tmp_path: Path) -> None:
    kernel = write_kernel(tmp_path, "6.1.0-1-amd64", {"uvc": ["usbcore"]}, built_in=("usbcore",))
    assert [p.name for p in kernel.load_order(("uvc", "usbcore"))] == ["uvc.ko.xz"]


def test_a_module_that_is_missing_is_an_error(tmp_path: Path) -> None:
    kernel = write_kernel(tmp_path, "6.1.0-1-amd64", {"uvc": []})
    with pytest.raises(LookupError):
        kernel.load_order(("vivid",))


def test_the_newest_kernel_that_has_all_modules_is_found(tmp_path: Path) -> None:
    """6.10 is newer than 6.9, and a cloud kernel has no cameras."""
    for version in ("6.9.7-amd64", "6.10.2-amd64", "5.10.0-30-amd64"):
        write_kernel(tmp_path, version, everything())
    cloud: dict[str, list[str]] = {name: [] for name in everything() if name != "uvcvideo"}
    write_kernel(tmp_path, "6.12.1-cloud-amd64", cloud)
    found = installed_kernel(tmp_path / "boot", tmp_path / "modules")
    assert found is not None
    assert found.version == "6.10.2-amd64"


def test_without_a_kernel_none_is_found(tmp_path: Path) -> None:
    assert installed_kernel(tmp_path / "boot", tmp_path / "modules") is None
