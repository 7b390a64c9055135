"""What is looked for on the page, whatever its tab: things cut off, too small for a finger, found by axe-core."""

from __future__ import annotations

from visitor import Visitor

# What is wider than the box that shows it, or stands outside the window
CUT = """() => { const cut = [], seen = e => e.checkVisibility() && e.clientWidth > 2 && !e.closest('.fa-hidden');
  for (const e of document.querySelectorAll('.mantine-Button-label, label, .fa-card, .fa p, .fa h1, .fa span'))
    if (seen(e) && e.scrollWidth > e.clientWidth + 1)
      cut.push(`${e.textContent}: ${e.scrollWidth} in ${e.clientWidth}`);
  for (const e of document.querySelectorAll('button, label, input, .fa-card, .fa-photo, [role=slider]')) {
    const box = e.getBoundingClientRect();
    if (e.checkVisibility() && (box.left < -0.5 || box.right > innerWidth + 0.5))
      cut.push(`${e.textContent || e.ariaLabel || e.className}: from ${box.left} to ${box.right} of ${innerWidth}`) }
  if (document.documentElement.scrollWidth > innerWidth) cut.push('the page scrolls sideways');
  return cut }"""
SMALL = """() => [...document.querySelectorAll(
    'button, a[href], input:not([type=hidden]), summary, select, [role=slider], [role=button], [role=tab]')]
  .filter(e => e.checkVisibility()).map(e => [e, e.getBoundingClientRect()])
  .filter(([, box]) => box.width && (box.width < 24 || box.height < 24))
  .map(([e, box]) => `${e.ariaLabel || e.textContent || e.className}: ${box.width} by ${box.height}`)"""
AXE = """async rules => (await axe.run(document, { resultTypes: ['violations'],
  ...(rules.length && { runOnly: rules }) })).violations.flatMap(
  found => found.nodes.map(node => [found.impact, found.id, node.html.slice(0, 200), node.failureSummary]))"""
# viser's own, that no style and no name of ours mends: (rule, part of the element) -> reason
VISERS: dict[tuple[str, str], str] = {}


def found_by_axe(me: Visitor, *rules: str) -> list[str]:
    """Serious and critical findings of `rules`, of all if none is named; without viser's."""
    return [
        f"{rule}: {html}: {why}"
        for impact, rule, html, why in me.tab.evaluate(AXE, list(rules))
        if impact in ("serious", "critical")
        and not any(rule == known and part in html for known, part in VISERS)
    ]
