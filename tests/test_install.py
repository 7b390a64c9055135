"""Installing a model: every file checked, nothing half there, and what was installed is found."""

from __future__ import annotations

import hashlib
import re
import threading
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

import faceambig.io as fio
from faceambig.errors import AssetError
from faceambig.io import install as installing
from faceambig.io.install import install, installed, models_folder
from model_files import gnm_head, gnm_rows, write_gnm


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch) -> Path:
    """The folder of installed models, empty."""
    monkeypatch.setenv("FACEAMBIG_MODELS", str(tmp_path / "models"))
    monkeypatch.delenv("FACEAMBIG_ICT", raising=False)
    return tmp_path / "models"


@pytest.fixture
def origin(tmp_path, monkeypatch) -> Path:
    """A place with a made-up GNM, and a list that says so."""
    place = tmp_path / "origin"
    place.mkdir()
    write_gnm(place / "gnm_head.npz", gnm_head(), gnm_rows())
    lines = ["# a made-up model", place.as_uri() + "/"]
    for name in ("gnm_head.npz", "head_sparse_68.txt"):
        data = (place / name).read_bytes()
        lines.append(f"{hashlib.sha256(data).hexdigest()} {len(data)} {name} {name}")
    (tmp_path / "models").mkdir(exist_ok=True)
    (place / "gnm.txt").write_text("\n".join(lines) + "\n")
    monkeypatch.setattr(installing, "asset_path", lambda name: place / Path(name).name)
    return place


@pytest.fixture
def server(origin) -> Iterator[str]:
    """The place, served on this machine."""

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - the name it overrides
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(origin))) as http:
        thread = threading.Thread(target=http.serve_forever, args=(0.01,))
        thread.start()
        yield f"http://127.0.0.1:{http.server_address[1]}"
        http.shutdown()
        thread.join()


def test_a_model_is_fetched_checked_and_found(origin, folder):
    seen: list[tuple[int, int]] = []
    where = install("gnm", progress=lambda done, total: seen.append((done, total)))
    assert where == folder / "gnm" == models_folder() / "gnm"
    assert sorted(file.name for file in where.iterdir()) == ["gnm_head.npz", "head_sparse_68.txt"]
    assert seen == [(0, 2), (1, 2)]
    assert installed("gnm") == where / "gnm_head.npz"
    assert len(fio.load_model("gnm").scheme("ibug68")) == 68
    (origin / "gnm_head.npz").unlink()
    assert install("gnm") == where  # it is there: nothing is fetched


def test_a_server_serves_as_well(server, folder):
    assert install("gnm", address=server).is_dir()
    assert [path.name for path in folder.iterdir()] == ["gnm"]


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        ("changed", "not the file that was checked (sha256 "),
        ("longer", "gnm_head.npz: more than "),
        ("missing", "cannot be fetched"),
        ("last", "head_sparse_68.txt: not the file that was checked"),
    ],
)
def test_nothing_is_left_of_what_was_not_checked(origin, folder, damage, said):
    file = origin / ("head_sparse_68.txt" if damage == "last" else "gnm_head.npz")
    data = file.read_bytes()
    file.write_bytes({"longer": data + b"x"}.get(damage, data[:-1] + b"x"))
    if damage == "missing":
        file.unlink()
    with pytest.raises(AssetError, match=re.escape(said)) as caught:
        install("gnm")
    assert "\n" not in str(caught.value)
    assert list(folder.iterdir()) == []
    assert installed("gnm") is None


def test_a_server_that_refuses_or_is_not_there_is_named(server):
    with pytest.raises(AssetError, match=r"gnm_head\.npz: the server answers 404 File not found"):
        install("gnm", address=server + "/elsewhere")
    with pytest.raises(AssetError, match=r"cannot be fetched \(.*refused"):
        install("gnm", address="http://127.0.0.1:9")


def test_other_names_and_addresses_are_refused(origin):
    with pytest.raises(ValueError, match="model: 'flame' cannot be installed; ict or gnm can"):
        install("flame")
    with pytest.raises(
        ValueError, match="address: 'ftp://a' does not begin with https:// or file://"
    ):
        install("gnm", address="ftp://a")
    text = (origin / "gnm.txt").read_text()
    (origin / "gnm.txt").write_text(text.replace(" gnm_head.npz\n", " ../gnm_head.npz\n"))
    with pytest.raises(AssetError, match=r"gnm\.txt: '\.\./gnm_head\.npz' leads out of the folder"):
        install("gnm")


@pytest.mark.parametrize("name", ["ict", "gnm"])
def test_what_is_not_installed_says_how(name):
    with pytest.raises(AssetError, match=f"{name}: .*faceambig models install {name}"):
        fio.load_model(name)


def test_the_lists_pin_a_revision_and_a_checksum_of_every_file(monkeypatch):
    for name, n in (("ict", 102), ("gnm", 2)):
        address, wanted = installing._listed(name)
        assert address.startswith("https://raw.githubusercontent.com/")
        assert len(wanted) == n
        for file in wanted:
            assert re.fullmatch(r"[0-9a-f]{64}", file.sha256)
            assert re.search(r"/[0-9a-f]{40}/", address + file.place)
    assert len({file.name for file in installing._listed("ict")[1]}) == 102


def test_the_checksums_of_ict_are_those_of_its_files(ict_path):
    _, wanted = installing._listed("ict")
    for file in wanted[:3]:
        data = (ict_path / file.name).read_bytes()
        assert (hashlib.sha256(data).hexdigest(), len(data)) == (file.sha256, file.size)
