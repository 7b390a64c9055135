"""The posterior: how probable each distance is, and how sure each place of the face.

python examples/04_how_probable.py
"""

from __future__ import annotations

import faceambig as fa

# 1. Points of a person photographed from 1 m, with noise of 1 % of the eye distance per coordinate.
model = fa.load_model("embedded")
photograph = fa.observe(model.subject(2), distance=1.0, noise_percent=1.0, seed=1)

# 2. All distances from 20 cm to 10 m, and beyond, with the faces that go with them.
posterior = fa.posterior(model, photograph, noise_percent=1.0)
for level in (0.5, 0.95):
    within = posterior.interval(level)
    end = "without end" if within.high is None else f"to {within.high:.2f} m"
    print(f"{100 * level:.0f} %: from {within.low:.2f} m {end}")
print(f"beyond 10 m: {100 * posterior.distance_density.beyond:.1f} %")

# 3. Faces drawn from it: all explain the points, at distances of their own.
faces = posterior.sample(5, seed=0)
print("drawn:", ", ".join(f"{distance:.2f} m" for distance in faces.distances))

# 4. Standard deviation of each vertex, millimetres, the distance unknown.
sd = posterior.vertex_sd_mm[model.evaluation]
print(
    f"sure to {sd.min():.1f} mm at best, {sd.max():.1f} mm at worst, {sd.mean():.1f} mm on average"
)
