"""The two networks of the automatic landmarks and their licence, anew: `python tools/fetch_nets.py [--wheel FILE]`.

They are files of the Python package `mediapipe`, read out of its wheel as an archive: nothing of it is installed or
run. Newer wheels hold no networks. Every file is checked before it is written below `assets/nets`.
"""

from __future__ import annotations

import argparse
import hashlib
import subprocess
import sys
import zipfile
from pathlib import Path

import platformdirs

from faceambig.io.nets import DETECTOR, MESH, SHA256

PACKAGE = "mediapipe==0.10.21"
WHEEL = "mediapipe-0.10.21-cp312-cp312-manylinux_2_28_x86_64.whl"
WHEEL_SHA256 = "956eb1ebc275c629e61b085b2cab89c3a5b9e93bad1bb107348d98dafb5a4bb5"
LICENCE_SHA256 = "8707eef0533987efc5b155d64761eeb6e20793f50b9bd1a68dad1cf4719d0ed8"
FILES = {  # in the wheel: name here, sha256
    f"mediapipe/modules/face_detection/{DETECTOR}": (DETECTOR, SHA256[DETECTOR]),
    f"mediapipe/modules/face_landmark/{MESH}": (MESH, SHA256[MESH]),
    "mediapipe-0.10.21.dist-info/LICENSE": ("LICENSE", LICENCE_SHA256),
}
FOLDER = Path(__file__).resolve().parents[1] / "assets" / "nets"


def main() -> None:
    """Write the three files."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--wheel", type=Path, help=f"{WHEEL}, if it is here already")
    wheel = find_wheel(arguments.parse_args().wheel)
    FOLDER.mkdir(exist_ok=True)
    with zipfile.ZipFile(wheel) as archive:
        for source, (name, sha256) in FILES.items():
            data = archive.read(source)
            check(source, data, sha256)
            (FOLDER / name).write_bytes(data)
            print(f"assets/nets/{name}: {len(data)} bytes, sha256 {sha256}")


def find_wheel(given: Path | None) -> Path:
    """Path of the checked wheel: the one given, else the cached one, else a fresh download."""
    path = given or Path(platformdirs.user_cache_dir("faceambig")) / "build" / WHEEL
    if given is None and not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        # One platform's wheel whatever this machine is: the networks are the same, the sum is the wheel's
        pip = [sys.executable, "-m", "pip", "download", "--no-deps", "--only-binary=:all:"]
        platform = ["--python-version", "3.12", "--platform", "manylinux_2_28_x86_64"]
        subprocess.run([*pip, *platform, "-d", str(path.parent), PACKAGE], check=True)
    check(str(path), path.read_bytes(), WHEEL_SHA256)
    return path


def check(name: str, data: bytes, sha256: str) -> None:
    """ValueError if `data` is not what it should be."""
    found = hashlib.sha256(data).hexdigest()
    if found != sha256:
        raise ValueError(f"{name}: sha256 is {found}, expected {sha256}")


if __name__ == "__main__":
    main()
