"""The page in windows of several sizes: two heads, nothing cut off, room for a finger.

Pictures are kept in the folder FACEAMBIG_ARTEFACTS, to be looked at.
"""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from audit import CUT, SMALL
from visitor import Visitor, artefacts

pytestmark = pytest.mark.browser

WINDOWS = [  # name, width, height
    ("desktop", 1440, 900),
    ("tablet", 820, 1180),
    ("smallest_docked", 577, 900),
    ("largest_sheet", 576, 900),
    ("phone_large", 414, 896),
    ("phone", 390, 844),
    ("phone_small", 360, 740),
]
BOTH_SCHEMES = ("desktop", "phone")


def look(me: Visitor) -> np.ndarray:
    """(H, W, 3) the window as it is seen, without notices."""
    png = me.tab.screenshot(style=".mantine-Notifications-root { display: none }")
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"))


@pytest.mark.parametrize(("name", "width", "height"), WINDOWS, ids=[name for name, *_ in WINDOWS])
def test_nothing_is_cut_off_and_a_finger_has_room(visit, tmp_path, name, width, height):
    sheet = width < 577
    # A phone has three pixels to one of the page; that must not make it a desk
    me = visit(width, height, dpr=0.5, device_scale_factor=3 if name == "phone_small" else 1)
    for scheme in ("light", "dark") if name in BOTH_SCHEMES else ("light",):
        me.tab.emulate_media(color_scheme=scheme)
        me.tab.wait_for_function(
            "scheme => document.documentElement.dataset.mantineColorScheme === scheme", arg=scheme
        )
        picture = look(me)
        Image.fromarray(picture).save(artefacts(tmp_path) / f"page_{name}_{scheme}.png")
        assert_two_heads(me, picture, sheet)
    assert me.tab.locator(".fa-both").count() == (1 if width < 1100 else 0)
    if sheet:  # the photograph and both numbers are seen before anything is scrolled
        # And the slider, but on small phones
        slider = ["[role=slider][aria-label='Assumed distance']"] if height > 800 else []
        for part in (".fa-photo", ".fa-card.fa-dl", ".fa-card.fa-ds", *slider):
            box = me.tab.locator(part).first.bounding_box()
            assert box["y"] >= 0.3 * height
            assert box["y"] + box["height"] <= height, part
    for tab in me.tab.get_by_role("tab").all():
        tab.click()
        me.tab.wait_for_function("tab => tab.ariaSelected === 'true'", arg=tab.element_handle())
        assert not me.tab.evaluate(CUT), tab.inner_text()
        assert not me.tab.evaluate(SMALL), tab.inner_text()
    me.tab.context.close()


def assert_two_heads(me: Visitor, picture: np.ndarray, sheet: bool) -> None:
    """Skin, redder than blue by far, on both halves of what is seen of the scene."""
    canvas, scale = me.canvas(), picture.shape[1] / me.tab.evaluate("() => innerWidth")
    x0, x1 = (round(scale * x) for x in (canvas["x"], canvas["x"] + canvas["width"]))
    scene = picture[: round((0.38 if sheet else 1) * len(picture)), x0:x1].astype(int)
    skin = scene[:, :, 0] > scene[:, :, 2] + 25
    left, right = np.array_split(skin, 2, axis=1)
    assert left.mean() > 0.03  # of the narrowest scene, beside a docked panel, 0.048
    assert right.mean() > 0.03
