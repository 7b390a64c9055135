"""What is given away: the wheel, the locks, the changelog, the two commands."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
LOCKS = ("requirements.lock", "requirements-dev.lock")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel of this checkout, unpacked. hatchling comes with the locks, so no network is asked."""
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    built = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert built.returncode == 0, built.stderr
    (packed,) = folder.glob("*.whl")
    with zipfile.ZipFile(packed) as archive:
        archive.extractall(folder / "unpacked")
    return folder / "unpacked"


def files_below(folder: Path) -> set[str]:
    names = {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}
    return {name for name in names if "__pycache__" not in name}


def test_wheel_installs_two_packages_and_nothing_beside_them(wheel: Path) -> None:
    metadata = f"faceambig-{PROJECT['version']}.dist-info"
    assert {path.name for path in wheel.iterdir()} == {"faceambig", "faceambig_app", metadata}
    assert (
        "faceambig = faceambig_app.cli:main" in (wheel / metadata / "entry_points.txt").read_text()
    )
    assert (wheel / metadata / "licenses" / "LICENSE").is_file()


def test_wheel_holds_every_module_and_asset(wheel: Path) -> None:
    assert files_below(ROOT / "faceambig") <= files_below(wheel / "faceambig")
    assert files_below(ROOT / "app" / "faceambig_app") == files_below(wheel / "faceambig_app")
    assert files_below(ROOT / "assets") == files_below(wheel / "faceambig" / "_assets")


def test_wheel_finds_its_assets_away_from_the_checkout(wheel: Path, tmp_path: Path) -> None:
    code = "import faceambig; print(faceambig.__file__, faceambig.load_model('embedded').n_modes)"
    # -S and -I would hide NumPy: what comes first on the path wins over the editable install
    run = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(wheel)!r}); {code}"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert run.returncode == 0, run.stderr
    file, n_modes = run.stdout.split()
    assert file.startswith(str(wheel))
    assert int(n_modes) > 0


def test_changelog_begins_with_this_version() -> None:
    versions = re.findall(
        r"^## \[?([0-9][^\]\s]*)", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE
    )
    assert versions[0] == PROJECT["version"]


def test_readme_names_both_commands() -> None:
    readme = (ROOT / "README.md").read_text()
    assert "make demo" in readme
    assert "make test" in readme


@pytest.mark.parametrize("name", LOCKS)
def test_lock_pins_and_hashes_everything_and_names_no_server(name: str) -> None:
    text = (ROOT / name).read_text()
    assert not re.search(r"://|--(extra-)?index-url|--find-links|--trusted-host", text)
    blocks = re.split(r"\n(?=\w)", re.sub(r"(?m)^\s*#.*\n", "", text))
    assert len(blocks) > 20
    assert [block for block in blocks if "--hash=sha256:" not in block or "==" not in block] == []


def test_locks_agree() -> None:
    app, dev = (set(re.findall(r"(?m)^(\S+==\S+)", (ROOT / name).read_text())) for name in LOCKS)
    assert app <= dev


def test_lock_holds_the_versions_that_the_code_is_written_for() -> None:
    app = (ROOT / LOCKS[0]).read_text()
    extras = PROJECT["optional-dependencies"]
    exact = [need for need in (*extras["app"], *extras["render"]) if "==" in need]
    # pyrender asks for PyOpenGL 3.1.0, which fails on Python 3.12: see pyproject.toml
    for need in [*exact, "pyopengl==3.1.10"]:
        assert re.search(rf"(?m)^{re.escape(need)}\b", app), need
