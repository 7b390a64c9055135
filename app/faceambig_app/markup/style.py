"""The page's style sheet: colours as variables for light and dark, sizes that grow with `--fa-scale`."""

from __future__ import annotations

SMALLEST, LARGEST = 1.0, 2.0  # of the text

_TOKENS = """
:root{--fa-ink:#1D2733;--fa-dim:#52606D;--fa-line:#D5DCE3;--fa-card:#F6F8FA;--fa-band:#E3EAF2;
--fa-dl:#1B5FC1;--fa-ds:#A84A00;--fa-seen:#C8102E;--fa-on:#FFF}
[data-mantine-color-scheme=dark]{--fa-ink:#E9EEF3;--fa-dim:#A9B4BF;--fa-line:#3C4650;--fa-card:#252A30;
--fa-band:#2B3540;--fa-dl:#7AB7FF;--fa-ds:#FFAB66;--fa-seen:#FF7A85;--fa-on:#181C21}
"""

_TEXT = """
.fa{color:var(--fa-ink);font-size:calc(14px*var(--fa-scale,1));line-height:1.45;padding:0 .75em .35em}
.fa h1{font-size:calc(17px*var(--fa-scale,1));font-weight:650;margin:.5em 0 .3em}
.fa p{margin:.35em 0}.fa small,.fa-small{font-size:calc(12.5px*var(--fa-scale,1));color:var(--fa-dim)}
.fa-hidden{position:absolute;width:1px;height:1px;overflow:hidden;clip-path:inset(50%)}
.fa-warn{border-left:4px solid #C8102E;padding-left:8px}
.fa summary{cursor:pointer;min-height:24px;color:var(--fa-dim);font-size:calc(12.5px*var(--fa-scale,1))}
.fa table{color:var(--fa-ink);border-collapse:collapse;
font-size:calc(12.5px*var(--fa-scale,1));font-variant-numeric:tabular-nums}
.fa caption{text-align:left;color:var(--fa-dim)}
.fa th,.fa td{padding:2px 8px 2px 0;text-align:right;font-weight:400;border-bottom:1px solid var(--fa-line)}
.fa th{color:var(--fa-dim)}.fa-wide{overflow-x:auto}
"""

_CARDS = """
.fa-cards{display:grid;grid-template-columns:repeat(auto-fit,minmax(calc(130px*var(--fa-scale,1)),1fr));gap:8px}
.fa-card{background:var(--fa-card);border-radius:8px;border-left:4px solid;padding:8px 10px}
.fa-card b{font-size:calc(13px*var(--fa-scale,1));display:block}
.fa-card span{font-size:calc(26px*var(--fa-scale,1));font-weight:700;
font-variant-numeric:tabular-nums;line-height:1.15;display:block}
.fa-card i{font-style:normal;font-size:calc(14px*var(--fa-scale,1))}
.fa-dl{border-color:var(--fa-dl)}.fa-dl span{color:var(--fa-dl)}
.fa-ds{border-color:var(--fa-ds)}.fa-ds span{color:var(--fa-ds)}
.fa-both{display:flex;flex-wrap:wrap;align-items:start;gap:4px 10px;padding:0 .75em .35em}
.fa-both>.fa:first-child{display:contents}.fa-both .fa-photo{order:1;flex:1 1 40%}
.fa-both>.fa:last-child{order:2;flex:999 1 calc(160px*var(--fa-scale,1));min-width:0;padding:0}
.fa-both .fa-key{order:3;flex:1 1 100%;padding-top:0}.fa-both .fa-cards{grid-template-columns:1fr}
.fa-bars{list-style:none;margin:.3em 0;padding:0}.fa-bars li{display:grid;grid-template-columns:1fr auto;gap:0 8px}
.fa-bars i{grid-column:1/3;height:8px;border-radius:2px;background:var(--fa-ds);margin-bottom:4px;min-width:1px}
.fa-legend{display:flex;gap:0 6px;align-items:start;font-variant-numeric:tabular-nums}
.fa-ramp{flex:1;height:14px;position:relative;margin-bottom:20px}
.fa-ramp span{position:absolute;top:15px;transform:translateX(-50%)}
.fa-ramp span:first-child{transform:none}.fa-ramp span:last-child:not(:first-child){transform:translateX(-100%)}
.fa-over{text-align:center;white-space:nowrap}.fa-over i{display:block;height:14px;min-width:24px}
"""

_LESSON = """
.fa-steps{display:flex;gap:6px;margin-top:.6em}
.fa-steps i{flex:1;height:5px;border-radius:3px;background:var(--fa-line)}
.fa-steps .fa-on{background:var(--fa-dl)}.fa-lesson{overflow-wrap:anywhere;padding-right:1.25em;scroll-margin-top:.5em}
.fa-lesson ul,.fa-lesson ol{margin:.3em 0;padding-left:1.4em}
.fa-said{border-left:4px solid var(--fa-dl);padding-left:8px}
.fa .fa-tasks{list-style:none;padding:0}.fa-tasks li{display:grid;grid-template-columns:1.6em 1fr;margin:.25em 0}
.fa-tasks span{display:inline-block;width:1.1em;height:1.1em;line-height:1.1em;text-align:center;border-radius:3px;
border:1.5px solid var(--fa-dim);color:var(--fa-dl);font-weight:700;margin-top:.15em}
.fa-done span{border-color:var(--fa-dl)}
"""

_ROOM = """
.fa-room button{border:0;padding:0;background:none;cursor:zoom-in;width:100%;max-width:13em;display:block}
.fa-room p{overflow-wrap:anywhere}.fa-room svg{display:block;width:100%;height:auto}
#fa-room{background:#FFF;color:#1D2733;border:0;border-radius:12px;padding:16px;max-width:92vw}
#fa-room svg{width:min(78vh,88vw)}#fa-room p{text-align:center;font-size:20px;width:min(78vh,88vw);margin:.4em 0 0}
#fa-room::backdrop{background:#0009}
.fa-note{background:var(--fa-ink);color:var(--mantine-color-body);border-left:4px solid var(--fa-ds);border-radius:8px;
font-size:calc(17px*var(--fa-scale,1));line-height:1.35;font-weight:600;padding:.45em .7em;overflow-wrap:anywhere;
margin:.3em calc(10.5px*var(--fa-scale,1))}
"""

_PHOTO = """
.fa-photo{position:relative;border-radius:8px;overflow:hidden;background-color:#CBD5E0;background-size:100% 100%;
aspect-ratio:1}.fa-photo svg{position:absolute;inset:0;width:100%;height:100%}
.fa-photo em{position:absolute;top:8px;left:8px;background:#FFFD;color:#1D2733;font-style:normal;
font-size:calc(12.5px*var(--fa-scale,1));padding:1px 7px;border-radius:4px}.fa-photo em:empty{display:none}
.fa-photo text{fill:#1D2733;stroke:#FFF;paint-order:stroke}
.fa-hit{stroke:transparent;stroke-width:24px;stroke-linecap:round;vector-effect:non-scaling-stroke;
pointer-events:stroke;fill:none}
[data-fa-point]{cursor:grab;outline:none}
[data-fa-point]:focus-visible .fa-hit,[data-fa-point]:hover .fa-hit{stroke:#FFFA}
.fa-photo[data-fa-place]{cursor:crosshair;touch-action:none}
.fa-ask{display:grid;grid-template-columns:90px 1fr;gap:0 12px;align-items:center}.fa-ask svg{width:90px}
.fa-defs{position:absolute;width:0;height:0}
.fa-key{display:flex;flex-wrap:wrap;gap:0 16px;font-size:calc(12.5px*var(--fa-scale,1));
color:var(--fa-dim);padding-top:4px}
.fa-key svg{width:calc(13px*var(--fa-scale,1));height:calc(13px*var(--fa-scale,1));vertical-align:-2px;margin-right:4px}
"""

_PLOTS = """
.fa-plot{display:block;width:calc(100%*var(--fa-scale,1));height:auto;font-size:11.5px}.fa-plot text{fill:var(--fa-dim);
stroke:var(--mantine-color-body);stroke-width:4px;stroke-linejoin:round;paint-order:stroke}
.fa-plot text.b{stroke:var(--fa-band)}
.fa-plot .t{font-weight:650;font-size:12.5px}
"""

_VISER = """
canvas[data-engine]{background:#F3F6F9}[data-mantine-color-scheme=dark] canvas[data-engine]{background:#181C21}
.mantine-Slider-root:has(.mantine-Slider-markLabel){padding-bottom:20px!important}
.mantine-Slider-markLabel{margin-top:7px;font-size:calc(11px*var(--fa-scale,1))!important;color:var(--fa-dim)!important}
label[for]{color:var(--fa-dim)!important;letter-spacing:0!important;font-size:calc(13px*var(--fa-scale,1))!important}
[data-mantine-color-scheme=dark] [style*="color: var(--mantine-primary-color-filled)"]{color:#7AB7FF!important}
.mantine-Button-root[data-variant=outline]{--button-color:var(--fa-dl)!important;
--button-bd:1px solid var(--fa-dl)!important}
.mantine-Button-root:not([data-variant=outline],[data-disabled]){--button-bg:#1B5FC1!important;background:#1B5FC1}
.mantine-Button-label{white-space:normal!important;height:auto!important;line-height:1.25;padding-block:2px}
button[aria-pressed=true]{background:var(--fa-dl)!important;color:var(--fa-on)!important}
[style*="text-overflow: ellipsis"][style*="letter-spacing"]{font-size:min(1rem,22px)}
.mantine-Flex-root:has(>div>p>label[for]){flex-wrap:wrap;row-gap:4px}
.mantine-Flex-root>div:has(>p>label[for]){flex:1 0 auto!important;max-width:100%}
.mantine-Flex-root>div:has(>p>label[for])+div{flex:100 1 9em!important;min-width:0}
.mantine-Flex-root>div:has(>p>label[for])+div:has([type=checkbox]){flex-basis:24px!important}
@media(max-width:576px){.mantine-Paper-root[style*="20em"]{width:100%!important;left:0!important;right:0!important}
.mantine-ScrollArea-content>div[style*="20em"]{width:100%!important}
.fa{line-height:1.35}.fa h1{margin:.2em 0}.fa-card{padding:4px 8px}
.fa-card span{font-size:calc(22px*var(--fa-scale,1))}}
"""

STYLE = f"<style>{_TOKENS}{_TEXT}{_CARDS}{_LESSON}{_ROOM}{_PHOTO}{_PLOTS}{_VISER}</style>"


# For eyes at the far end of a room. Widths in percent are of the photograph, others of the plot's own units
_BOLD = """
.fa-plot polyline{stroke-width:3.6px}.fa-plot path[stroke="var(--fa-ink)"]:not([stroke-width="6"],[stroke-width="3"]){
stroke-width:2.4px}.fa-plot path[stroke="var(--fa-dim)"]{stroke-width:1.8px}.fa-plot path[stroke="var(--fa-line)"]{
stroke-width:1.6px}.fa-plot .far{stroke-width:2.4px}
.fa-photo use{stroke-width:.62%}.fa-photo [stroke="#FFF"] use,.fa-photo use[stroke="#FFF"]{stroke-width:1.2%}
.fa-key path{stroke-width:2.6px!important}.fa-card,.fa-said,.fa-note{border-left-width:7px!important}
.fa-tasks span{border-width:2.5px}.fa-bars i{height:16px}
@media(min-width:1100px){.fa-note{position:fixed;bottom:16px;left:50%;transform:translateX(-50%);margin:0;
width:max-content;max-width:calc(100vw - 2*var(--fa-side) - 32px)}}
@media(min-width:1800px){.fa-plot{width:100%}}
"""


def text_size(scale: float) -> str:
    """The size of all text, 1 to 2, as a style."""
    return f"<style>:root{{--fa-scale:{min(LARGEST, max(SMALLEST, scale)):g}}}</style>"


def bold(side: int) -> str:
    """Thicker lines, and the note across the scene. side: pixels of each panel beside it."""
    return f"<style>:root{{--fa-side:{side}px}}{_BOLD}</style>"
