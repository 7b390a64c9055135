"""The README says what is so: its lines run and print what it says they print."""

from __future__ import annotations

import contextlib
import io
import re
from pathlib import Path

README = (Path(__file__).resolve().parents[1] / "README.md").read_text(encoding="utf-8")


def test_its_python_prints_what_it_says():
    (code,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    said = re.findall(r"`(\d[\d.]* converged [\d.]+ %)`", README)
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        exec(code, {})
    assert out.getvalue().splitlines() == said
    assert len(said) == 2


def test_its_commands_exist():
    from faceambig_app.cli import parser

    commands = re.findall(r"^faceambig (\w+)", README, re.MULTILINE)
    assert set(commands) == {
        "serve", "snapshot", "animate", "fit", "sweep", "modes", "posterior", "landmarks", "models", "reproduce",
    }  # fmt: skip
    for line in re.findall(r"^faceambig (.+?)(?:\s+#.*)?$", README, re.MULTILINE):
        parser().parse_args(line.split())


def test_its_links_lead_somewhere():
    root = Path(__file__).resolve().parents[1]
    for target in re.findall(r"\]\(([^)]+)\)", README):
        assert (root / target).is_file(), target
