"""Commands run inside the test: what they print, and the one line of a refusal."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from faceambig_app.cli import main

Capture = pytest.CaptureFixture[str]
RECORD = {
    "status", "camera", "distance_m", "rotation", "translation_m", "alpha", "cost", "d_l_percent", "steps", "version",
}  # fmt: skip


def write_pts(path: Path, points: np.ndarray) -> Path:
    rows = "\n".join("nan nan" if np.isnan(x) else f"{x:.6f} {y:.6f}" for x, y in points)
    path.write_text(f"version: 1\nn_points: {len(points)}\n{{\n{rows}\n}}\n", encoding="utf-8")
    return path


def printed(capsys: Capture, *arguments: object) -> tuple[int, str, str]:
    """(status, stdout, stderr) of a command; argparse exits, commands return."""
    try:
        status = main([str(argument) for argument in arguments])
    except SystemExit as left:
        status = left.code if isinstance(left.code, int) else 1
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def refused(capsys: Capture, *arguments: object) -> str:
    """The one line of a refusal."""
    status, out, err = printed(capsys, *arguments)
    assert status == 2
    assert out == ""
    assert err.endswith("\n")
    assert err.count("\n") == 1, err
    assert "Traceback" not in err
    assert err.startswith("faceambig")
    assert len(err) < 400
    return err
