"""Every distance at once: which of them can the points not tell from the best?

python examples/02_all_distances.py
"""

from __future__ import annotations

import faceambig as fa

# 1. A photograph whose points were clicked: noise of 1 % of the eye distance, the same in every run.
model = fa.load_model("embedded")
photograph = fa.observe(model.subject(2), distance=0.6, noise_percent=1.0, seed=1)

# 2. Follow the best face along the distance, 20 cm to 3 m, and to a camera infinitely far away.
sweep = fa.sweep_distance(model, photograph)
for distance in (0.2, 0.3, 0.6, 1.2, 2.4):
    fit = sweep.nearest(distance)
    print(f"{fit.distance:5.2f} m: points {fit.d_l_percent:.2f} % off")
print(f"far away: points {sweep.orthographic.d_l_percent:.2f} % off")

# 3. The distances within a tolerance. None means there is no end on that side.
for tolerance in (1.1, 3.0):
    interval = sweep.interval(tolerance)
    low = "the nearest" if interval.low is None else f"{interval.low:.2f} m"
    high = "infinity" if interval.high is None else f"{interval.high:.2f} m"
    print(f"within {tolerance} %: from {low} to {high}")

# 4. How fast the face changes on the way: mm for every doubling of the distance.
speed = sweep.speed_mm_per_octave()
print(f"the face changes by {speed.min():.1f} to {speed.max():.1f} mm per doubling")
