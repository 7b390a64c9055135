"""What every exported file says of itself: program and version, state, model, licence; and what it is called."""

from __future__ import annotations

from functools import cache
from importlib.metadata import version

from ..pipeline.fits import model
from ..state import ViewState
from ..state.forms import to_json


def provenance(state: ViewState) -> dict[str, str]:
    """Program and version, state, model and licence, by the names of PNG's text where it has one: to make it again."""
    of = model(state.model)
    return {
        "Software": f"faceambig {_version()}",
        "ViewState": to_json(state),
        "Model": f"{of.name}: {of.source}",
        "Licence": of.licence,
    }


@cache
def _version() -> str:
    return version("faceambig")  # reads a file of the package


def notes(state: ViewState) -> tuple[str, ...]:
    """The same as lines, for formats that have comments."""
    return tuple(f"{name}: {value}" for name, value in provenance(state).items())


def who(state: ViewState) -> str:
    """subject3_30cm: who was photographed, and from where; of a photograph of one's own nothing is known."""
    if isinstance(state.subject, str):
        return state.subject
    return f"subject{state.subject}_{centimetres(state.actual)}"


def shown(state: ViewState) -> str:
    """subject3_30cm_as_120cm: a photograph, and the distance its fit assumes; of a strip, that it is one."""
    if state.show == "row":
        return f"{who(state)}_row"
    assumed = "far" if state.camera == "orthographic" else centimetres(state.distance)
    return f"{who(state)}_as_{assumed}"


def file_name(words: str, ending: str) -> str:
    """faceambig_subject3_30cm_as_120cm.png of `shown` and "png"; `ending` may begin with more words: "fit.ply"."""
    return f"faceambig_{words}{'_' if '.' in ending else '.'}{ending}"


def centimetres(metres: float) -> str:
    """30cm, 22.5cm: three significant digits."""
    return f"{float(f'{100 * metres:.3g}'):g}cm"
