"""One photograph, two faces: the same points explained from two distances.

python examples/01_two_faces.py
"""

from __future__ import annotations

import faceambig as fa
from faceambig.metrics import surface_difference

# 1. A face model, and a photograph: the 68 points of a synthetic person seen from 30 cm.
model = fa.load_model("embedded")
person = model.subject(2)
photograph = fa.observe(person, distance=0.3)

# 2. Fit at the right distance, and at one four times as far.
near = fa.fit(model, photograph, distance=0.3)
far = fa.fit(model, photograph, distance=1.2)

# 3. Both explain the points within what a person can click, 3 % of the eye distance.
for words, fit in (("30 cm", near), ("1.2 m", far)):
    print(f"assumed {words}: {fit.status}, points {fit.d_l_percent:.2f} % from where they are")

# 4. And they are two faces: mean distance of the surfaces, laid on each other.
d_s = surface_difference(near.vertices(), far.vertices(), model.evaluation).mean
print(f"the faces differ by {1000 * d_s:.1f} mm")
