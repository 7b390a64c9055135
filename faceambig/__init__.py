"""faceambig: fit a 3D morphable face model to one photograph's points, and see the faces the points leave open.

After A. Bas and W. A. P. Smith, "What does 2D geometric information really tell us about 3D face shape?", IJCV 2019.

    import faceambig as fa
    model = fa.load_model("embedded")
    obs = fa.observe(model.subject(3), distance=0.3)
    fit = fa.fit(model, obs, distance=1.2)
    fit.d_l_percent
"""

from __future__ import annotations

from .conditioned import condition
from .contours import ContourFit, ContourStatus, contour_fit
from .density import DistanceDensity, DistanceInterval
from .errors import AssetError
from .extremes import ExtremeFace, ExtremeFaces, extreme_faces
from .fitting import Failure, Fit, FitOptions, Status, fit, fit_batch
from .flex import FlexibilityModes, KeptModes, flexibility_modes
from .io import load_fit, load_landmarks, load_model, save_fit
from .model import FaceModel, Scheme, Subject
from .observation import Observation, observe
from .posterior import FaceSamples, Posterior, posterior
from .shading import ExplainedShading, Light, explain_shading, shade
from .spread import PosteriorModes, SurfaceSpread, posterior_modes, surface_spread
from .sweep import Interval, Sweep, sweep_distance

__all__ = [
    "AssetError",
    "ContourFit",
    "ContourStatus",
    "DistanceDensity",
    "DistanceInterval",
    "ExplainedShading",
    "ExtremeFace",
    "ExtremeFaces",
    "FaceModel",
    "FaceSamples",
    "Failure",
    "Fit",
    "FitOptions",
    "FlexibilityModes",
    "Interval",
    "KeptModes",
    "Light",
    "Observation",
    "Posterior",
    "PosteriorModes",
    "Scheme",
    "Status",
    "Subject",
    "SurfaceSpread",
    "Sweep",
    "condition",
    "contour_fit",
    "explain_shading",
    "extreme_faces",
    "fit",
    "fit_batch",
    "flexibility_modes",
    "load_fit",
    "load_landmarks",
    "load_model",
    "observe",
    "posterior",
    "posterior_modes",
    "save_fit",
    "shade",
    "surface_spread",
    "sweep_distance",
]
