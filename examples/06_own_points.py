"""Points of one's own in, a mesh out: what the points of a photograph become.

python examples/06_own_points.py [points.pts] [face.ply]
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

import faceambig as fa
from faceambig.arrays import vertex_normals
from faceambig.io.meshes import Mesh, encode_ply

folder = Path(tempfile.mkdtemp(prefix="faceambig-"))
points = Path(sys.argv[1]) if len(sys.argv) > 1 else folder / "points.pts"
out = Path(sys.argv[2]) if len(sys.argv) > 2 else folder / "face.ply"
model = fa.load_model("embedded")

# 1. Points as annotation programs write them: without a file of one's own, those of a synthetic person.
if len(sys.argv) < 2:
    rows = [f"{x:.3f} {y:.3f}" for x, y in fa.observe(model.subject(4), distance=0.5).points]
    points.write_text("\n".join(["version: 1", "n_points: 68", "{", *rows, "}"]) + "\n")

# 2. Read them. The size of the picture says where its middle is.
read = fa.load_landmarks(points, image_size=(500, 500), model=model)
photograph = fa.Observation(read.points, read.scheme, image_size=read.image_size)

# 3. Fit, assuming a distance: no photograph tells it, so say it with the result.
distance = 0.5
fit = fa.fit(model, photograph, distance=distance)
print(f"{fit.status}: points {fit.d_l_percent:.2f} % off, camera assumed {distance} m away")

# 4. Write the face, in metres.
vertices = fit.vertices()
grey = np.full(vertices.shape, 190, dtype=np.uint8)
note = f"faceambig, {model.name}, camera assumed {distance} m away"
mesh = Mesh(vertices, model.faces, grey, vertex_normals(vertices, model.faces), (note,))
out.write_bytes(encode_ply(mesh))
print(f"written: {out.name}, {model.n_vertices} vertices")
