"""What import-linter cannot see: the core's list of packages, and what a start of the program loads."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
# They meet files and screens; everything else in the library is the core.
OUTER = ("io", "render", "experiments")
CORE = [
    path
    for path in sorted((ROOT / "faceambig").rglob("*.py"))
    if path.relative_to(ROOT / "faceambig").parts[0] not in OUTER
]
HEAVY = {"cv2", "numpy", "pyrender", "scipy", "trimesh", "viser"}


def imported(tree: ast.Module) -> set[str]:
    names: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            names.add(node.module.split(".")[0])
    return names


@pytest.mark.parametrize("path", CORE, ids=lambda path: str(path.relative_to(ROOT)))
def test_core_needs_numpy_and_scipy_and_touches_no_file(path: Path) -> None:
    tree = ast.parse(path.read_text())
    allowed = {"numpy", "scipy"} | ({"joblib"} if path.name == "batch.py" else set())
    assert imported(tree) - sys.stdlib_module_names <= allowed
    called = {
        node.func.id
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
    }
    assert not called & {"open", "print", "input", "exec", "eval"}


def loaded_by(statement: str) -> set[str]:
    code = f"import sys; {statement}; print(*{{name.split('.')[0] for name in sys.modules}})"
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    return set(run.stdout.split())


def test_library_is_imported_without_the_page_and_its_packages() -> None:
    assert not loaded_by("import faceambig") & (
        (HEAVY | {"faceambig_app", "joblib", "msgspec"}) - {"numpy", "scipy"}
    )


def test_command_line_starts_without_loading_anything_heavy() -> None:
    # `faceambig --help` answers in the time of argparse, not in the second that scipy and viser take
    assert not loaded_by("import faceambig_app.cli") & (HEAVY | {"faceambig"})


def test_state_link_and_history_do_without_numpy_and_viser() -> None:
    modules = ("state", "state.forms", "state.link", "state.history", "state.actions")
    statement = "import " + ", ".join(f"faceambig_app.{name}" for name in modules)
    assert not loaded_by(statement) & (HEAVY | {"faceambig"})
