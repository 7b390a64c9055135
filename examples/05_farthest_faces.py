"""The two farthest faces that one photograph cannot tell apart, with a proof of how far any could be.

python examples/05_farthest_faces.py
"""

from __future__ import annotations

import faceambig as fa

# 1. A fit at the right distance.
model = fa.load_model("embedded")
fit = fa.fit(model, fa.observe(model.subject(2), distance=0.6), distance=0.6)

# 2. As far from it as 3 % on the points and 2 sd in every mode allow, in opposite ways.
found = fa.extreme_faces(model, fit, tolerance_percent=3.0)
for face in found.faces:
    print(f"{face.d_s_mm:.1f} mm from the fit, points {face.landmark_rms_percent:.2f} % off (rms)")

# 3. No face is farther than the bound, so the search can be judged.
print(f"bound {found.bound_mm:.1f} mm; reached {100 * found.ratio:.0f} % of it")
