"""The page in memory: viser's, with our script before its own and our mends of its bundle."""

from __future__ import annotations

import base64
import gzip
import hashlib
import html
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import viser
import zstandard

from faceambig.io import asset_path

from ..text import words
from .data import data_meta
from .pinned import VISER, ServeError

# assets/page/*.js, joined in this order
PARTS = (
    "channel",
    "look",
    "keys",
    "scene",
    "colours",
    "names",
    "copy",
    "photo",
    "probe",
    "keep",
    "status",
)

# viser sends the changes of a panel's controls through one sender, which every 50 ms keeps the newest message: a value
# set less than 50 ms before another control changes never arrives. Ours keeps the newest of each control, in order,
# and sends what waits when its panel is closed.
_SENDER = (
    "function RL(e,t){let n=!0,r=!1,i=null,a=null;function o(s){let c=e.mutable.current;c.sendMessage!==null&&(i=s,"
    "n?(c.sendMessage(s),r=!1,n=!1,a=setTimeout(()=>{a=null,n=!0,r&&i&&o(i)},t)):r=!0)}function s(){"
    "e.mutable.current.sendMessage!==null&&i!==null&&r&&(e.mutable.current.sendMessage(i),i=null,r=!1)}"
    "function c(){a!==null&&(clearTimeout(a),a=null),n=!0,r=!1,i=null}return{send:o,flush:s,cancel:c}}"
)
_OUR_SENDER = (
    "function RL(e,t){let waiting=new Map,timer=null;"
    "function flush(){let m=e.mutable.current,all=[...waiting.values()];waiting.clear();"
    "if(m.sendMessage!==null)for(let one of all)m.sendMessage(one);return all.length>0}"
    "function pause(){timer=setTimeout(()=>{timer=null;if(flush())pause()},t)}"
    "function send(one){if(e.mutable.current.sendMessage===null)return;let key=one.type+(one.uuid??'');"
    "waiting.delete(key);waiting.set(key,one);if(timer===null){flush();pause()}}"
    "function cancel(){if(timer!==null)clearTimeout(timer);timer=null;flush()}"
    "return{send,flush,cancel}}"
)
# The canvas is told in device pixels, three to a pixel of the page on a phone; the page's own decide the layout.
_CANVAS = "image_height:o.height,image_width:o.width,fov:"
_OUR_CANVAS = "image_height:o.clientHeight,image_width:o.clientWidth,fov:"
# Dark, where the page around viser's asks for it, stays for ever; our script is asked at every change.
_DARK = "r=n.useGui(e=>e.theme.dark_mode),i=t||r,"
_OUR_DARK = "r=n.useGui(e=>window.__faceambig?.dark(e.theme.dark_mode)??e.theme.dark_mode),i=t||r,"
PATCHES = ((_SENDER, _OUR_SENDER), (_CANVAS, _OUR_CANVAS), (_DARK, _OUR_DARK))
_PACKED = re.compile(
    r'<script data-p="([^"]*)" data-ss="(\d+)" data-cs="(\d+)">(.*?)</script>', re.DOTALL
)
# In the loader, which unpacks the bundle
_UNPACKED = "const code=td.decode(heap.subarray(up+ss,up+sz));"
# viser's packing: zstd in base 88, five characters for four bytes.
_DIGITS = "".join(chr(c) for c in range(0x21, 0x7F) if chr(c) not in "\"&'<>`")


@dataclass(frozen=True)
class Page:
    """The page in memory, with what its policy must name."""

    text: bytes
    zipped: bytes
    hashes: tuple[str, ...]  # of our script, viser's loader, viser's bundle

    def policy(self, origin: str) -> str:
        """What the page may load and whom it may speak to: `origin`, where it comes from."""
        scripts = " ".join(f"'sha256-{value}'" for value in self.hashes)
        return (
            f"default-src 'none'; script-src 'wasm-unsafe-eval' {scripts}; worker-src blob: data:; "
            "style-src 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:; "
            f"connect-src 'self' {origin.replace('http', 'ws', 1)} data: blob:; "
            "object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
        )


def our_script() -> str:
    """Our script: the parts in one function, so that they see each other and nobody else sees them."""
    parts = "\n".join(asset_path(f"page/{part}.js").read_text(encoding="utf-8") for part in PARTS)
    return f'(() => {{\n"use strict";\n{parts}}})();\n'


def make_page(script: str, title: str, patches: Sequence[tuple[str, str]]) -> Page:
    """viser's page with our script before its own. The loader mends the bundle, so that it stays packed as it is."""
    if "</script" in script.lower():
        raise ServeError("the script of the page: must not hold the end of a script element")
    source = Path(viser.__file__).parent / "client" / "build" / "index.html"
    text = source.read_text(encoding="utf-8")
    found = _PACKED.search(text)
    if found is None or found[4].count(_UNPACKED) != 1:
        raise ServeError(f"viser {VISER}: its page is not packed as expected: install it again")
    size = int(found[2]) + int(found[3])
    code = (
        zstandard.ZstdDecompressor()
        .decompress(_from_base88(found[1]), size)[int(found[2]) :]
        .decode()
    )
    mends = ""
    for old, new in patches:
        if code.count(old) != 1:
            raise ServeError(f"viser {VISER}: its script is not as expected: install it again")
        code = code.replace(old, new)
        mends += f".replace({json.dumps(old)},()=>{json.dumps(new)})"
    loader = found[4].replace(_UNPACKED, f"{_UNPACKED[:-1]}{mends};")
    text = (
        text[: found.start()].replace(
            "<title>Viser</title>", f"<title>{html.escape(title)}</title>"
        )
        + data_meta("words", words()["page"])
        + data_meta("icons", words()["icon"])
        + f"<script>{script}</script>"
        + text[found.start() : found.start(4)]
        + loader
        + text[found.end(4) :]
    )
    parts = (script, loader, code)
    hashes = (base64.b64encode(hashlib.sha256(part.encode()).digest()).decode() for part in parts)
    return Page(text.encode(), gzip.compress(text.encode(), 6), tuple(hashes))


def _from_base88(text: str) -> bytes:
    worth = np.zeros(127, np.int64)
    worth[[ord(c) for c in _DIGITS]] = np.arange(88)
    whole = len(text) // 5 * 5
    digits = worth[np.frombuffer(text.encode(), np.uint8)]
    packed = (digits[:whole].reshape(-1, 5) @ 88 ** np.arange(4, -1, -1)).astype(">u4").tobytes()
    rest = 0
    for digit in digits[whole:].tolist():
        rest = rest * 88 + digit
    return (
        packed + rest.to_bytes(4, "big")[5 - (len(text) - whole) :] if whole < len(text) else packed
    )
