"""Errors a user can mend, each one line: what is wrong, the value, what is accepted.

ValueError            arguments
|-- AssetError        files: a model, a landmark scheme, a picture, points
|-- BeyondTolerance   a fit that misses the points by more than other faces are allowed to
`-- NotConverged      points and settings for which a fit that the answer rests on has no end

Command line: the message on stderr, exit status 2. Page: a red notice.
"""

from __future__ import annotations

from collections.abc import Iterable


class AssetError(ValueError):
    """A file that cannot be read or does not hold what it should."""


class BeyondTolerance(ValueError):
    """A fit misses its points by more than the tolerance within which other faces are looked for."""


class NotConverged(ValueError):
    """A fit that an answer would rest on did not converge: the same call fails again."""


def listed(values: Iterable[object]) -> str:
    """'a, b or c': the choices of an error message."""
    names = [str(value) for value in values]
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} or {names[-1]}"
