"""Write a version into every file that states it: `python setup/set_version.py 0.3.0`."""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

PLACES = (
    ('pyproject.toml', r'^version = "(.+)"$'),
    ('CITATION.cff', r'^version: (.+)$'),
    ('porotwin_*/package.xml', r'^  <version>(.+)</version>$'),
    ('setup/metapackage/package.xml', r'^  <version>(.+)</version>$'),
    ('porotwin_core/porotwin_core/__init__.py', r"^__version__ = '(.+)'$"),
)
"""Glob patterns of files, and the line of each that states the version."""


def stated() -> dict[Path, str]:
    """Return the version that each file states.

    Raises:
        ValueError: a file states none.
    """
    found = {}
    for pattern, line in PLACES:
        for path in sorted(ROOT.glob(pattern)):
            match = re.search(line, path.read_text(encoding='utf-8'), re.MULTILINE)
            if match is None:
                raise ValueError(f'{path} states no version')
            found[path] = match[1]
    return found


def write(version: str) -> None:
    """Write `version` into all files."""
    for path, old in stated().items():
        text = path.read_text(encoding='utf-8')
        for _, line in PLACES:
            match = re.search(line, text, re.MULTILINE)
            if match is not None and match[1] == old:
                text = text[: match.start(1)] + version + text[match.end(1) :]
        path.write_text(text, encoding='utf-8')


if __name__ == '__main__':
    if len(sys.argv) != 2 or not re.fullmatch(r'\d+\.\d+\.\d+', sys.argv[1]):
        raise SystemExit('usage: python setup/set_version.py 0.3.0')
    write(sys.argv[1])
