"""Write CHANGELOG.rst of every ROS package (REP-132) from the one CHANGELOG.md, for a release.

`python setup/make_changelogs.py` writes beside each package.xml. Git ignores these files.
"""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

VERSION = re.compile(r'^## (?:Unreleased|(\d+\.\d+\.\d+) \((\d{4}-\d\d-\d\d)\))$', re.MULTILINE)
UNRELEASED = 'Forthcoming'
"""The title that REP-132 gives to changes without a version."""


def versions(text: str) -> list[tuple[str, list[str]]]:
    """Return the title of every version in the text of CHANGELOG.md, and its changes in RST."""
    parts = VERSION.split(text)[1:]
    return [
        (f'{number} ({date})' if number else UNRELEASED, changes(body))
        for number, date, body in zip(parts[::3], parts[1::3], parts[2::3], strict=True)
    ]


def changes(body: str) -> list[str]:
    """Return the items and paragraphs of a version, each as one line of RST."""
    blocks = re.split(r'\n\n|\n(?=- )', re.sub(r'^#.*$|^[\w ,]+:$', '', body, flags=re.MULTILINE))
    lines = (' '.join(block.split()).removeprefix('- ') for block in blocks)
    return [re.sub(r'`([^`]+)`', r'``\1``', line) for line in lines if line]


def page(package: str, text: str) -> str:
    """Return CHANGELOG.rst of a package, from the text of CHANGELOG.md."""
    title = f'Changelog for package {package}'
    bar = '^' * len(title)
    lines = [bar, title, bar, '']
    for name, items in versions(text):
        lines += [name, '-' * len(name), *(f'* {item}' for item in items), '']
    return '\n'.join(lines)


def main() -> None:
    """Write the file of each package."""
    text = (ROOT / 'CHANGELOG.md').read_text(encoding='utf-8')
    for folder in sorted(path.parent for path in ROOT.glob('*/**/package.xml')):
        name = re.search('<name>(.+)</name>', (folder / 'package.xml').read_text(encoding='utf-8'))
        if name is not None:
            (folder / 'CHANGELOG.rst').write_text(page(name[1], text), encoding='utf-8')


if __name__ == '__main__':
    main()
