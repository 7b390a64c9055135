"""What every exported file says of itself: program and version, state, model, licence; and what it is called."""

from __future__ import annotations

from importlib.metadata import version

from .fits import model
from .forms import to_json
from .state import ViewState


def provenance(state: ViewState) -> dict[str, str]:
    """Where a file comes from, by name: enough to make it again. Names are those of PNG's text where it has one."""
    face = model(state.model)
    return {
        "Software": f"faceambig {version('faceambig')}",
        "ViewState": to_json(state),
        "Model": f"{face.name}: {face.source}",
        "Licence": face.licence,
    }


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
