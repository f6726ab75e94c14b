"""Run trials: `python -m tests.support.stop_trials --seeds 0:1000 --at-once 12 [--out FILE]`.

Prints the tree of faults and each exception; the exit code is 1 if there is one. With `--out` each
outcome is also written as a line of JSON. `--show` prints what one seed has seen.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

_PRELOADED = "GONIO_STOP_TRIALS"


def main() -> int:
    """Return 0 if no trial was an exception."""
    wanted = _arguments()
    if _PRELOADED not in os.environ:
        with tempfile.TemporaryDirectory() as name:
            return subprocess.run(
                [sys.executable, "-m", "tests.support.stop_trials", *sys.argv[1:]],
                env={**os.environ, **_hung_disk(Path(name)), _PRELOADED: "1"}, check=False,
            ).returncode  # fmt: skip
    from tests.support.stop_trials.tally import exceptions, tree
    from tests.support.stop_trials.trial import draw
    from tests.support.stop_trials.workers import run_all

    first, _, end = wanted.seeds.partition(":")
    seeds: Sequence[int] = range(int(first), int(end) if end else int(first) + 1)
    if wanted.fault:
        seeds = [seed for seed in seeds if draw(seed).fault == wanted.fault]
    gc.collect()
    gc.freeze()  # what the forked processes share
    outcomes = []
    with open(wanted.out or os.devnull, "a", encoding="utf-8") as file:  # noqa: PTH123 - a device
        for outcome in run_all(seeds, wanted.at_once, show=wanted.show):
            outcomes.append(outcome)
            file.write(json.dumps(asdict(outcome)) + "\n")
            file.flush()
    sys.stdout.write(f"{tree(outcomes)}\n")
    wrong = exceptions(outcomes)
    sys.stdout.write("".join(f"{line}\n" for line in wrong))
    return int(bool(wrong) or len(outcomes) != len(seeds))


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="tests.support.stop_trials")
    parser.add_argument("--seeds", default="0:24", help="one seed, or FIRST:END")
    parser.add_argument("--fault", help="only the seeds that draw this fault")
    parser.add_argument("--at-once", type=int, default=8, help="trials at the same time")
    parser.add_argument("--out", type=Path, help="file for the outcomes, a JSON object a line")
    parser.add_argument("--show", action="store_true", help="print all that a trial has seen")
    return parser.parse_args()


def _hung_disk(folder: Path) -> dict[str, str]:
    """Compile the library that lets a disk hang; return the environment that preloads it."""
    library = folder / "hung_disk.so"
    source = Path(__file__).parents[1] / "storage" / "hung_disk.c"
    compiler = shutil.which("cc") or "cc"
    options = ["-O1", "-Wall", "-Werror", "-shared", "-fPIC"]
    subprocess.run([compiler, *options, "-o", library, source, "-ldl"], check=True, timeout=60)
    return {"LD_PRELOAD": str(library)}


if __name__ == "__main__":
    sys.exit(main())
