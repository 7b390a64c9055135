"""What experiments found, written down: CSV, JSON and PNG for each, and one HTML page that holds all and asks nobody.

The page has no script, and its policy lets in its own style and the pictures that are in it, nothing else.
"""

from __future__ import annotations

import base64
import csv
import io
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from hashlib import sha256
from html import escape
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from faceambig.experiments.protocol import Cell, Claim, Experiment, Outcome, Table
from faceambig.io.files import asset_path
from faceambig.render.graph import draw_chart
from faceambig.render.overlay import encode_png

from ..text import language, say

VERDICTS = {True: "holds", False: "fails", None: "open"}


class Done(NamedTuple):
    """An experiment that was asked for, and what came of it."""

    experiment: Experiment
    outcome: Outcome | None
    failure: str = ""  # why there is none, in one line


class Drawn(NamedTuple):
    """A picture of an outcome."""

    file: str
    words: str  # for those who do not see it
    png: bytes
    titled: bool  # the words are in the picture


def drawn(outcome: Outcome) -> list[Drawn]:
    """Its charts and images, in order."""
    charts = [
        Drawn(
            f"{outcome.name}_chart{k}.png", chart.title, _png(draw_chart(chart), chart.title), True
        )
        for k, chart in enumerate(outcome.charts, 1)
    ]
    images = [
        Drawn(f"{outcome.name}_image{k}.png", image.title, _png(image.pixels, image.title), False)
        for k, image in enumerate(outcome.images, 1)
    ]
    return charts + images


def files_of(outcome: Outcome, pictures: Sequence[Drawn]) -> dict[str, bytes]:
    """Name and content of every file of an outcome: each table as CSV, all of it as JSON, each picture as PNG."""
    files = {
        f"{outcome.name}_table{k}.csv": _csv(table) for k, table in enumerate(outcome.tables, 1)
    }
    record = json.dumps(record_of(outcome), allow_nan=False, indent=1, ensure_ascii=False)
    files[f"{outcome.name}.json"] = (record + "\n").encode()
    return files | {picture.file: picture.png for picture in pictures}


def record_of(outcome: Outcome) -> dict[str, Any]:
    """The outcome for a program, all digits; numbers that are none are null, pictures are named by their files."""
    record = asdict(outcome)
    record["images"] = [
        {"title": image.title, "file": f"{outcome.name}_image{k}.png"}
        for k, image in enumerate(outcome.images, 1)
    ]
    return _plain(record)


def html(
    done: Sequence[Done], pictures: Mapping[str, Sequence[Drawn]], asked: Mapping[str, str]
) -> str:
    """The report. pictures: of each outcome, by name; asked: what was run, for the head of the page."""
    style = asset_path("report.css").read_text(encoding="utf-8")
    digest = base64.b64encode(sha256(style.encode()).digest()).decode()
    parts = [_section(each, pictures.get(each.experiment.name, ())) for each in done]
    return "\n".join(
        (
            f'<!doctype html>\n<html lang="{language()}">\n<head>\n<meta charset="utf-8">',
            (
                f'<meta http-equiv="Content-Security-Policy" content="default-src \'none\'; img-src data:; '
                f"style-src 'sha256-{digest}'; base-uri 'none'; form-action 'none'\">"
            ),
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<title>{escape(say('report.title'))}</title>\n<style>{style}</style>\n</head>\n<body>\n<main>",
            f"<h1>{escape(say('report.title'))}</h1>",
            f"<p>{escape(say('report.lead'))}</p>",
            _settings(asked),
            _summary(done),
            *parts,
            "</main>\n</body>\n</html>\n",
        )
    )  # fmt: skip


def verdict(claim: Claim) -> str:
    """Whether a claim holds, in words."""
    match claim.holds:
        case True:
            return say("report.holds")
        case False:
            return say("report.fails")
        case None:
            return say("report.open")


def shown(cell: Cell, decimals: int = 2) -> str:
    """A cell of a table as people read it; a number that is none is a dash."""
    if cell is None or (isinstance(cell, float) and not math.isfinite(cell)):
        return "–"
    if isinstance(cell, float):
        return f"{cell:.{decimals}f}".replace("-", "\u2212")
    return str(cell)


def _summary(done: Sequence[Done]) -> str:
    """Every claim in a row, with a link to its experiment."""
    rows = []
    for each in done:
        link = f'<a href="#{each.experiment.name}">{escape(each.experiment.paper)}</a>'
        if each.outcome is None:
            rows.append(f'<tr><td>{link}</td><td colspan="4">{escape(each.failure)}</td></tr>')
            continue
        rows += [
            f"<tr><td>{link}</td><td>{escape(claim.words)}</td><td>{escape(claim.paper)}</td>"
            f"<td>{escape(claim.ours)}</td>{_verdict_cell(claim)}</tr>"
            for claim in each.outcome.claims
        ]
    return _table_html(say("report.summary"), _claim_columns(say("report.where")), rows)


def _claim_columns(*first: str) -> list[str]:
    ours = say("report.says"), say("report.paper"), say("report.ours"), say("report.verdict")
    return [*first, *ours]


def _verdict_cell(claim: Claim) -> str:
    return f'<td class="{VERDICTS[claim.holds]}">{escape(verdict(claim))}</td>'


def _section(done: Done, pictures: Sequence[Drawn]) -> str:
    experiment, outcome = done.experiment, done.outcome
    head = f'<section id="{experiment.name}">\n<h2>{escape(experiment.paper)}: {escape(experiment.title)}</h2>'
    if outcome is None:
        return f"{head}\n<p>{escape(say('report.not_run', why=done.failure))}</p>\n</section>"
    claims = []
    for claim in outcome.claims:
        row = "".join(f"<td>{escape(cell)}</td>" for cell in (claim.words, claim.paper, claim.ours))
        claims.append(f"<tr>{row}{_verdict_cell(claim)}</tr>")
        if claim.why:
            claims.append(f'<tr class="why"><td colspan="4">{escape(claim.why)}</td></tr>')
    figures = [_figure(picture) for picture in pictures]
    tables = [_outcome_table(table) for table in outcome.tables]
    return "\n".join(
        (
            head,
            _table_html(say("report.claims"), _claim_columns(), claims) if claims else "",
            *figures,
            *tables,
            _settings({name: shown(value) for name, value in outcome.settings.items()}),
            "</section>",
        )
    )


def _figure(picture: Drawn) -> str:
    data = base64.b64encode(picture.png).decode()
    words = escape(picture.words)
    below = "" if picture.titled else f"<figcaption>{words}</figcaption>"
    return f'<figure><img alt="{words}" src="data:image/png;base64,{data}">{below}</figure>'


def _outcome_table(table: Table) -> str:
    rows = []
    for row in table.rows:
        cells = [f"<td{_right(cell)}>{escape(shown(cell, table.decimals))}</td>" for cell in row]
        rows.append(f"<tr>{''.join(cells)}</tr>")
    note = f" ({table.note})" if table.note else ""
    sides = [_right(cell) for cell in table.rows[0]] if table.rows else []
    return _table_html(f"{table.title}{note}", table.columns, rows, sides)


def _right(cell: Cell) -> str:
    """Numbers stand at the right of their column."""
    return "" if isinstance(cell, str) else ' class="number"'


def _table_html(
    caption: str, columns: Sequence[str], rows: Sequence[str], sides: Sequence[str] = ()
) -> str:
    """sides: attributes of the columns' heads."""
    head = "".join(
        f'<th scope="col"{sides[k] if sides else ""}>{escape(column)}</th>'
        for k, column in enumerate(columns)
    )
    return (
        f'<div class="wide"><table><caption>{escape(caption)}</caption>\n<thead><tr>{head}</tr></thead>\n'
        f"<tbody>{''.join(rows)}</tbody></table></div>"
    )


def _settings(settings: Mapping[str, str]) -> str:
    items = "".join(f"<dt>{escape(k)}</dt><dd>{escape(v)}</dd>" for k, v in settings.items())
    return f"<dl>{items}</dl>"


def _csv(table: Table) -> bytes:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(table.columns)
    writer.writerows(table.rows)
    return text.getvalue().encode()


def _png(pixels: NDArray[np.uint8], title: str) -> bytes:
    opaque = np.full((*pixels.shape[:2], 1), 255, dtype=np.uint8)
    words = {"Software": "faceambig", "Description": title}
    return encode_png(np.concatenate([pixels, opaque], axis=2), words)


def _plain(value: Any) -> Any:
    """For JSON, which knows no NaN and no infinity."""
    if isinstance(value, Mapping):
        return {str(name): _plain(each) for name, each in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(each) for each in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value
