"""What is given away: the wheel, the source, the locks, the changelog, the citation, the two commands."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import sysconfig
import tarfile
import tomllib
import venv
import zipfile
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
LOCKS = ("requirements.lock", "requirements-dev.lock")


def built(kind: str, source: Path, folder: Path) -> Path:
    """The `kind`, wheel or sdist, of a source tree. hatchling comes with the locks, so no network is asked."""
    command = [sys.executable, "-m", "hatchling", "build", "-t", kind, "-d", str(folder)]
    done = subprocess.run(command, cwd=source, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    (file,) = folder.glob("faceambig-*")
    return file


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel of this checkout, unpacked."""
    folder = tmp_path_factory.mktemp("wheel")
    with zipfile.ZipFile(built("wheel", ROOT, folder)) as archive:
        archive.extractall(folder / "unpacked")
    return folder / "unpacked"


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The source distribution of this checkout, unpacked."""
    folder = tmp_path_factory.mktemp("sdist")
    with tarfile.open(built("sdist", ROOT, folder)) as archive:
        # Python 3.11.2 has no filter
        archive.extraction_filter = getattr(tarfile, "data_filter", lambda member, _: member)
        archive.extractall(folder)
    return folder / f"faceambig-{PROJECT['version']}"


@pytest.fixture(scope="module")
def installed(source: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """bin/ of a new environment with the wheel of the source distribution; what it needs is this one's, behind it."""
    folder = tmp_path_factory.mktemp("installed")
    file = built("wheel", source, folder)
    own_pip = find_spec("pip") is None  # uv makes environments without it
    try:
        venv.create(folder / "venv", with_pip=own_pip)
    except subprocess.CalledProcessError as error:  # Debian without python3-venv
        pytest.skip(f"no pip for a new environment: {error}")
    programs = folder / "venv" / "bin"
    python = programs / "python"
    pip = [python, "-m", "pip"] if own_pip else [sys.executable, "-m", "pip", "--python", python]
    command = [*pip, "install", "--no-deps", "--no-index", "--no-compile", file]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    (site,) = (folder / "venv").glob("lib/python*/site-packages")
    (site / "needed.pth").write_text(sysconfig.get_path("purelib") + "\n")
    return programs


def ran(program: Path, *arguments: str, cwd: Path) -> str:
    """What it prints, away from the checkout and with nothing of it on the path."""
    env = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    command = [program, *arguments]
    done = subprocess.run(command, cwd=cwd, env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


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


def test_source_holds_what_builds_tests_and_documents_it(source: Path) -> None:
    for name in ("faceambig", "app", "assets", "docs", "examples", "tests", "tools"):
        missing = files_below(ROOT / name) - files_below(source / name)
        assert {one for one in missing if not one.startswith((".", "_build/"))} == set(), name
    for name in ("CITATION.cff", "CHANGELOG.md", "LICENSE", "Makefile", *LOCKS):
        assert (source / name).read_bytes() == (ROOT / name).read_bytes()
    assert not list(source.rglob("__pycache__"))


@pytest.mark.slow
def test_wheel_of_the_source_installs_and_runs(installed: Path, tmp_path: Path) -> None:
    program = installed / "faceambig"
    assert ran(program, "--version", cwd=tmp_path) == f"faceambig {PROJECT['version']}\n"
    code = "import faceambig, faceambig_app; print(faceambig.__file__, faceambig_app.__file__)"
    for file in ran(installed / "python", "-c", code, cwd=tmp_path).split():
        assert Path(file).is_relative_to(installed.parent)
    record = json.loads(ran(program, "models", "embedded", "--json", cwd=tmp_path))
    assert record["vertices"] == 14_159


@pytest.mark.gl
@pytest.mark.slow
def test_what_is_installed_draws_the_page_s_picture(installed: Path, tmp_path: Path) -> None:
    ran(installed / "faceambig", "snapshot", "--out", "face.png", "--width", "600", cwd=tmp_path)
    data = (tmp_path / "face.png").read_bytes()
    assert data.startswith(b"\x89PNG")
    assert int.from_bytes(data[16:20]) == 600


def test_citation_names_this_version_and_the_paper() -> None:
    yaml = pytest.importorskip("yaml")
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    # What the schema of version 1.2.0 asks for
    assert {"cff-version", "message", "title", "authors"} <= cited.keys()
    assert cited["cff-version"] == "1.2.0"
    assert str(cited["version"]) == PROJECT["version"]
    assert cited["license"] == PROJECT["license"]
    assert [one["name"] for one in cited["authors"]] == [one["name"] for one in PROJECT["authors"]]
    (paper,) = cited["references"]
    assert [one["family-names"] for one in paper["authors"]] == ["Bas", "Smith"]
    assert paper["title"] in " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())


def test_changelog_begins_with_this_version() -> None:
    versions = re.findall(
        r"^## \[?([0-9][^\]\s]*)", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE
    )
    assert versions[0] == PROJECT["version"]


def test_release_notes_are_of_versions_newest_first() -> None:
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    heads = re.findall(r"(?m)^## (.*)$", text)
    found = [
        re.fullmatch(r"\[(\d+)\.(\d+)\.(\d+)\] - (unreleased|\d{4}-\d\d-\d\d)", h) for h in heads
    ]
    assert all(found), heads
    versions = [tuple(map(int, one.groups()[:3])) for one in found if one]
    assert versions == sorted(set(versions), reverse=True)
    assert not any("unreleased" in head for head in heads[1:])
    kinds = {"Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"}
    assert set(re.findall(r"(?m)^### (.*)$", text)) <= kinds
    # What is said of a version is a list, one line each
    assert not re.findall(r"(?m)^(?!#|- |$).*$", text.partition("\n## ")[2].partition("\n")[2])


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
