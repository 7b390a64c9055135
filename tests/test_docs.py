"""The documentation says what is so: sessions print what they show, flags are the parsers', links lead somewhere."""

from __future__ import annotations

import doctest
import importlib.util
import re
from dataclasses import asdict
from pathlib import Path
from types import ModuleType

import pytest

from faceambig.model import FaceModel

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
PAGES = sorted(path for path in DOCS.rglob("*.md") if "_build" not in path.parts)
SESSION = re.compile(r"```pycon\n(.*?)```", re.DOTALL)


def session(path: Path) -> str:
    """The sessions of a page as one, with as many lines before each as in the page, for the numbers of a failure."""
    text = path.read_text(encoding="utf-8")
    done = ""
    for found in SESSION.finditer(text):
        line = text.count("\n", 0, found.start(1))
        done += "\n" * (line - done.count("\n")) + found[1]
    return done


def tool(name: str, folder: Path = ROOT / "tools") -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, folder / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    "path",
    [p for p in PAGES if SESSION.search(p.read_text("utf-8"))],
    ids=lambda p: f"{p.parent.name}-{p.stem}",
)
def test_sessions_print_what_the_page_shows(path: Path) -> None:
    parsed = doctest.DocTestParser().get_doctest(session(path), {}, path.name, str(path), 0)
    assert parsed.examples
    report: list[str] = []
    result = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(parsed, out=report.append)
    assert not result.failed, "".join(report)


def test_page_of_commands_is_what_the_parsers_say() -> None:
    reference = tool("command_reference")
    assert reference.PAGE.read_text("utf-8") == reference.page(), (
        "python tools/command_reference.py"
    )


def test_page_of_commands_holds_every_flag() -> None:
    from faceambig_app.cli import parser

    text = (DOCS / "commands.md").read_text("utf-8")
    (group,) = (action for action in parser()._actions if action.dest == "command")
    assert isinstance(group.choices, dict)
    for name, command in group.choices.items():
        _, _, rest = text.partition(f"\n## {name}\n")
        part = rest.partition("\n## ")[0]
        for action in command._actions:
            for flag in set(action.option_strings) - {"-h", "--help"}:
                assert re.search(rf"`{flag}[ `]", part), (name, flag)


def test_page_of_the_library_holds_every_public_name() -> None:
    import faceambig

    named = re.findall(r"\.\. auto\w+:: (\w+)", (DOCS / "api.md").read_text("utf-8"))
    assert sorted(named) == sorted(faceambig.__all__)


def test_fields_of_a_class_are_listed_with_what_the_source_says_beside_them() -> None:
    from faceambig import Fit

    listed = tool("docstrings", DOCS / "_ext").fields(Fit)
    assert "* ``alpha: Array`` -- (S,) shape, in standard deviations" in listed
    assert sum(line.startswith("* ") for line in listed) == len(Fit.__dataclass_fields__)


def test_docstrings_mean_nothing_but_their_own_marks() -> None:
    converted = tool("docstrings", DOCS / "_ext").converted
    given = """Largest |alpha_j| of `model`.

    E = |x|^2

Parameters
----------
box: largest |alpha_j|,
    in sd.

Raises
------
ValueError: *not* a number.
"""
    assert [line for line in converted(given.splitlines()) if line] == [
        r"Largest \|alpha\_j\| of ``model``.",
        "::",
        "    E = |x|^2",
        ".. rubric:: Parameters",
        r"* ``box``: largest \|alpha\_j\|, in sd.",
        ".. rubric:: Raises",
        r"* ``ValueError``: \*not\* a number.",
    ]


def test_gallery_holds_every_experiment_with_its_pictures() -> None:
    from faceambig.experiments import NAMES

    text = (DOCS / "gallery.md").read_text("utf-8")
    assert re.findall(r"(?m)^`faceambig reproduce (\w+)`$", text) == list(NAMES)
    shown = re.findall(r"\]\(gallery/([^)]+)\)", text)
    assert sorted(shown) == sorted(path.name for path in (DOCS / "gallery").iterdir())


@pytest.mark.parametrize("name", ["fig1", "fig4a"])  # the two that cost least
def test_gallery_says_what_the_experiment_finds(name: str, embedded: FaceModel) -> None:
    from faceambig.experiments import experiment
    from faceambig.experiments.protocol import Settings, silent

    outcome = experiment(name).run(Settings(embedded, "embedded"), silent)
    row = tool("docs_gallery").claim_row
    text = (DOCS / "gallery.md").read_text("utf-8")
    for claim in outcome.claims:
        assert row(asdict(claim)) in text


def test_every_page_is_in_the_table_of_contents() -> None:
    named = set(re.findall(r"(?m)^([\w/-]+)$", (DOCS / "index.md").read_text("utf-8")))
    assert {path.stem for path in DOCS.glob("*.md")} - {"index"} <= named


@pytest.mark.parametrize("path", PAGES, ids=lambda p: f"{p.parent.name}-{p.stem}")
def test_links_lead_somewhere(path: Path) -> None:
    for target in re.findall(r'(?:\]\(|href=")([^)"]+)', path.read_text("utf-8")):
        file = target.partition("#")[0]
        if file and "://" not in file:
            assert (path.parent / file).is_file(), target
