"""Bend a fitted face behind its points: flexibility modes, and how far they stay a face.

python examples/03_bend.py
"""

from __future__ import annotations

import faceambig as fa
from faceambig.camera import project

# 1. A fit at the right distance: nothing is wrong with it.
model = fa.load_model("embedded")
photograph = fa.observe(model.subject(3), distance=0.6)
fit = fa.fit(model, photograph, distance=0.6)

# 2. Its three most flexible modes: much surface for little movement of the points.
modes = fa.flexibility_modes(model, fit, count=3)
for number, words in enumerate(modes.words):
    low, high = modes.reach(number)
    print(f"mode {number + 1}: {words}; a face from {low:.1f} to {high:+.1f} mm, ", end="")
    print(f"points move {modes.landmark_percent[number]:.3f} % per mm")

# 3. Bend along the first as far as it is a face, and look where the points go.
mm = modes.reach(0)[1]
bent = fit.alpha + mm * modes.directions[0]
rows = model.scheme("ibug68").vertices
before, after = (project(fit.camera, model.vertices(alpha)[rows]) for alpha in (fit.alpha, bent))
gaps = ((after - before) ** 2).sum(axis=1) ** 0.5
print(f"bent by {mm:.1f} mm the points move {100 * gaps.mean() / fit.interocular_px:.3f} %")
