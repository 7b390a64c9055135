"""Shared by all tests: one BLAS thread, hypothesis without a clock, and the models, loaded once a session."""

# ruff: noqa: E402 - the number of threads is chosen before NumPy is loaded

from __future__ import annotations

import importlib
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

# More BLAS threads than cores make a fit of 1 ms take a second
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import platformdirs
import pytest
from hypothesis import settings

import faceambig.io as fio
from faceambig.model import FaceModel

# The same examples on every run and machine: a failure is a change of the code, never of the weather
settings.register_profile("ci", deadline=None, derandomize=True, max_examples=100)
# By hand, for the readers of files: fifty times as many examples, and others in every run
settings.register_profile("long", deadline=None, max_examples=5000, print_blob=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci"))

NO_ICT = (
    "no ICT-FaceKit: FACEAMBIG_ICT names no folder, ../shared/tools/unpack_ict.sh finds no archive"
)


BENCHMARKS = Path(__file__).resolve().parents[1] / "benchmarks"


def cache_folder() -> Path:
    """The user's cache, where unpacked models survive between runs; else a temporary folder."""
    try:
        return platformdirs.user_cache_path("faceambig", ensure_exists=True)
    except OSError:
        return Path(tempfile.gettempdir()) / "faceambig"


def ict_folder() -> Path | None:
    """Where ICT-FaceKit lies, unpacked at the first call; None if it is not there."""
    if named := os.environ.get("FACEAMBIG_ICT"):
        return Path(named)
    script = Path(__file__).resolve().parents[2] / "shared" / "tools" / "unpack_ict.sh"
    if not script.is_file():
        return None
    done = subprocess.run(
        ["bash", str(script), str(cache_folder() / "ict")],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode == 3:  # no archive
        return None
    if done.returncode:
        raise RuntimeError(done.stderr.strip())
    return Path(done.stdout.strip())


@pytest.fixture(scope="session")
def embedded() -> FaceModel:
    """The embedded head."""
    return fio.load_model("embedded")


@pytest.fixture(scope="session")
def ict_path() -> Path:
    """The folder of ICT-FaceKit; skips without it."""
    folder = ict_folder()
    if folder is None:
        pytest.skip(NO_ICT)
    return folder


@pytest.fixture(scope="session")
def ict(ict_path: Path) -> FaceModel:
    """ICT-FaceKit's face part, origin between the eyes; skips without it."""
    return fio.load_model(ict_path)


@pytest.fixture(scope="module")
def benchmarks() -> Iterator[Callable[[str], Any]]:
    """Imports a script of the benchmarks as its neighbours find it: their folder on the path."""
    before = set(sys.modules)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(BENCHMARKS))
        yield importlib.import_module
    for name in set(sys.modules) - before:  # their names are too plain to stay
        if Path(getattr(sys.modules[name], "__file__", None) or "").parent == BENCHMARKS:
            del sys.modules[name]


@pytest.fixture(scope="module")
def wires(benchmarks: Callable[[str], Any]) -> Any:
    """The browser without pictures of the soak test."""
    return benchmarks("wire")
