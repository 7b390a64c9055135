"""The numbers of the curves as a table: what a person reads who does not see the plots."""

from __future__ import annotations

from html import escape

import numpy as np

from faceambig.scene import Curves

from ..text import numeral, percent_number, say

MOST_ROWS = 25  # distances; the far-away camera has a row of its own


def table(curves: Curves, true: bool = True) -> str:
    """The curves as numbers, folded away; at most MOST_ROWS of them, first and last among them."""
    n = len(curves.distances)
    rows = np.unique(np.linspace(0, n - 1, min(n, MOST_ROWS)).round().astype(int))
    heads = [say("plot.axis"), say("plot.d_l"), *([say("plot.d_s")] if true else [])]
    likely = curves.density
    if likely is not None:
        heads.append(say("plot.likely_share"))
    body = []
    for row in rows:
        cells = [percent_number(float(curves.d_l_percent[row]))]
        if true:
            cells.append(numeral(f"{curves.d_s_mm[row]:.1f}"))
        if likely is not None:
            cells.append(f"{100 * likely[row]:.0f}")
        numbers = "".join(f"<td>{cell}</td>" for cell in cells)
        body.append(f'<tr><th scope="row">{100 * curves.distances[row]:.0f}</th>{numbers}</tr>')
    body.append(_far_row(curves, true))
    head = "".join(f'<th scope="col">{escape(text)}</th>' for text in heads)
    return (
        f'<details><summary>{escape(say("plot.table"))}</summary><div class="fa-wide"><table><thead><tr>{head}</tr>'
        f"</thead><tbody>{''.join(body)}</tbody></table></div></details>"
    )


def _far_row(curves: Curves, true: bool) -> str:
    """The last row: the far-away camera, which is no distance that could be likely."""
    d_l, d_s = curves.orthographic
    cells = [percent_number(d_l), *([numeral(f"{d_s:.1f}")] if true else [])]
    cells += [""] if curves.density is not None else []
    numbers = "".join(f"<td>{cell}</td>" for cell in cells)
    return f'<tr><th scope="row">{escape(say("plot.far"))}</th>{numbers}</tr>'
