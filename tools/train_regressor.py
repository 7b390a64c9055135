"""A small learned regressor for `faceambig reproduce fig9`: ridge regression from pixels to shape, as an ONNX file.

python tools/train_regressor.py regressor.onnx          # 1,500 rendered heads, all from 120 cm
faceambig reproduce fig9 --regressor regressor.onnx

It is linear, knows one model's rendered heads in one light, frontal, from one distance, and nothing of photographs:
what it shows is how a regressor that was taught at one distance answers at others.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np

import faceambig as fa
from faceambig.arrays import Array
from faceambig.experiments.heads import drawn, usual_scheme
from faceambig.experiments.regressor import square
from faceambig.model import FaceModel, Subject

TAUGHT_SEED = 1  # of the heads; the experiment's own are drawn with another
HELD_OUT = 0.1  # share of the heads that choose the ridge
RIDGES = (1e-3, 1e-2, 1e-1, 1.0, 10.0, 100.0)
FLOAT, VERSION = 1, 13  # of ONNX: the type of its numbers, and the operators' version


def main() -> None:
    """Render, solve, write, and say how well shapes of held-out heads are told."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("file", type=Path, help="ONNX file to write")
    parser.add_argument("--model", default="embedded")
    parser.add_argument("--heads", type=int, default=1500)
    parser.add_argument("--distance", type=float, default=1.2, help="metres, of every picture")
    parser.add_argument("--side", type=int, default=48, help="pixels of the network's square")
    parser.add_argument("--modes", type=int, default=30, help="shape modes it tells")
    options = parser.parse_args()
    model = fa.load_model(options.model)
    X, Y = pictures(model, options.heads, options.distance, options.side, options.modes)
    W, b, said = solved(X, Y)
    options.file.write_bytes(linear_network(W, b, options.side))
    print(f"{options.file}: {options.file.stat().st_size} bytes; {said}")


def pictures(
    model: FaceModel, n: int, distance: float, side: int, modes: int
) -> tuple[Array, Array]:
    """Pixels (n, 3 side side), 0 to 1, channel by channel, and shapes (n, modes) of drawn heads."""
    scheme = usual_scheme(model)
    X, Y = np.empty((n, 3 * side * side)), np.empty((n, modes))
    for k in range(n):
        alpha = drawn(model.n_modes, k + 1, TAUGHT_SEED)
        face = Subject("", "", model.vertices(alpha), model.colours, model)
        X[k] = square(face, distance, scheme, side).transpose(2, 0, 1).ravel() / 255.0
        Y[k] = alpha[:modes]
    return X, Y


def solved(X: Array, Y: Array) -> tuple[Array, Array, str]:
    """W (D, P) and b (D,) of the ridge that tells held-out heads best, and how well."""
    held = max(1, round(HELD_OUT * len(X)))
    taught, asked = X[held:], X[:held]
    mean, middle = taught.mean(axis=0), Y[held:].mean(axis=0)
    A = taught - mean
    gram = A @ A.T
    best = None
    for ridge in RIDGES:
        dual = np.linalg.solve(gram + ridge * np.eye(len(A)), Y[held:] - middle)
        told = (asked - mean) @ A.T @ dual + middle
        error = float(((told - Y[:held]) ** 2).mean())
        if best is None or error < best[0]:
            best = error, ridge, A.T @ dual
    assert best is not None
    error, ridge, W = best
    first = float(((((asked - mean) @ W + middle) - Y[:held])[:, :5] ** 2).mean())
    said = (
        f"held-out heads: {1 - error:.2f} of the variance of {Y.shape[1]} modes, "
        f"{1 - first:.2f} of the first 5 (ridge {ridge:g})"
    )
    return W.T, middle - mean @ W, said


def linear_network(W: Array, b: Array, side: int) -> bytes:
    """An ONNX file of one layer: (1, 3, side, side) flattened, times W (D, 3 side side), plus b (D,)."""
    D, P = W.shape
    flatten = _message((1, b"image"), (2, b"flat"), (4, b"Flatten"), (5, _attribute("axis", 1)))
    gemm = _message(
        (1, b"flat"), (1, b"W"), (1, b"b"), (2, b"shape"), (4, b"Gemm"), (5, _attribute("transB", 1))
    )  # fmt: skip
    graph = _message(
        (1, flatten), (1, gemm), (2, b"shape of a face"),
        (5, _tensor("W", W)), (5, _tensor("b", b)),
        (11, _value("image", (1, 3, side, side))), (12, _value("shape", (1, D))),
    )  # fmt: skip
    assert 3 * side * side == P
    return _message((1, 7), (2, b"faceambig"), (7, graph), (8, _message((1, b""), (2, VERSION))))


def _message(*fields: tuple[int, int | bytes]) -> bytes:
    """Fields of protocol buffers: whole numbers and bytes."""
    parts = []
    for number, value in fields:
        if isinstance(value, int):
            parts.append(_varint(number << 3) + _varint(value))
        else:
            parts.append(_varint(number << 3 | 2) + _varint(len(value)) + value)
    return b"".join(parts)


def _varint(value: int) -> bytes:
    parts = bytearray()
    while value >= 0x80:
        parts.append(value & 0x7F | 0x80)
        value >>= 7
    parts.append(value)
    return bytes(parts)


def _attribute(name: str, value: int) -> bytes:
    return _message((1, name.encode()), (3, value), (20, 2))


def _tensor(name: str, values: Array) -> bytes:
    data = values.astype("<f4").tobytes()
    return _message(
        *((1, size) for size in values.shape), (2, FLOAT), (8, name.encode()), (9, data)
    )


def _value(name: str, shape: tuple[int, ...]) -> bytes:
    sizes = _message(*((1, _message((1, size))) for size in shape))
    return _message((1, name.encode()), (2, _message((1, _message((1, FLOAT), (2, sizes))))))


if __name__ == "__main__":
    main()
