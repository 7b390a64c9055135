"""One photograph, two faces: the same points explained from two distances.

    python examples/01_two_faces.py
"""

from __future__ import annotations

import faceambig as fa

# 1. A face model, and a photograph: the 68 points of a synthetic person seen from 30 cm.
model = fa.load_model("embedded")
person = model.subject(2)
photograph = fa.observe(person, distance=0.3)

# 2. Fit at the right distance, and at one four times as far.
near = fa.fit(model, photograph, distance=0.3)
far = fa.fit(model, photograph, distance=1.2)

# 3. Both explain the points within what a person can click, 3 % of the eye distance.
for name, fit in (("30 cm", near), ("1.2 m", far)):
    print(f"assumed {name}: {fit.status}, points {fit.d_l_percent:.2f} % from where they are")

# 4. And they are two faces.
apart = fa_distance = ((model.vertices(near.alpha) - model.vertices(far.alpha)) ** 2).sum(axis=1) ** 0.5
print(f"the two faces are {1000 * apart.mean():.1f} mm apart on average, {1000 * apart.max():.1f} mm at most")
