"""A Scene as HTML and SVG of the page: words, numbers, the photograph, the curves, their style."""
