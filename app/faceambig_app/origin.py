"""Where a state's file comes from: enough to make it again."""

from __future__ import annotations

from functools import cache
from importlib.metadata import version

from faceambig.model import FaceModel

from .forms import to_json
from .state import ViewState


def origin(state: ViewState, model: FaceModel) -> dict[str, str]:
    """Program and version, state, model and licence, by the names of PNG's text where it has one."""
    return {
        "Software": f"faceambig {_version()}",
        "ViewState": to_json(state),
        "Model": f"{model.name}: {model.source}",
        "Licence": model.licence,
    }


@cache
def _version() -> str:
    return version("faceambig")  # reads a file of the package
