"""Count clauses that are hard to read in docstrings, comments, messages and documents.

    python tests/prose.py                 # a table: words, clauses, clauses per 1,000 words
    python tests/prose.py porotwin_hub    # every clause of one package, with its line

A hard clause begins with a word of HARD, such as a preposition and a relative pronoun. Well-known
numerical libraries have 0.5 to 2 of them per 1,000 words of docstrings.
"""

import ast
import io
import re
import sys
import tokenize
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

HARD = re.compile(
    r'\b(?:what'
    r'|(?:of|by|in|with|for|from|to|at|on|through|beside|after|before|within) which'
    r'|(?:that|those) of)\b',
    re.IGNORECASE,
)

MOST_PER_1000 = 2.0
"""Clauses per 1,000 words that a package or a folder of documents may have."""

Text = tuple[int, str]
"""A line number and the text that begins there."""


def packages() -> list[str]:
    """Return the names of all packages and of the folders with tests, examples and documents."""
    names = [path.parent.name for path in ROOT.glob('porotwin_*/setup.py')]
    more = ('lab', 'tests', 'examples', 'docs', 'setup')
    return [*sorted(names), *(name for name in more if (ROOT / name).is_dir())]


def prose_of(path: Path) -> Iterator[Text]:
    """Yield the docstrings, comments and messages of a module, or the lines of a document."""
    text = path.read_text(encoding='utf-8')
    if path.suffix == '.md':
        yield from _of_document(text)
    else:
        yield from _of_module(text)


def _of_document(text: str) -> Iterator[Text]:
    inside_code = False
    for number, line in enumerate(text.splitlines(), 1):
        inside_code ^= line.startswith('```')
        if not inside_code:
            yield number, line


def _of_module(text: str) -> Iterator[Text]:
    lines = io.StringIO(text if '#' in text else '')  # most files have no comment
    for token in tokenize.generate_tokens(lines.readline):
        if token.type == tokenize.COMMENT:
            yield token.start[0], token.string
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and ' ' in node.value:
            yield node.lineno, node.value


def files_of(name: str) -> list[Path]:
    """Return the modules and documents of a package or folder, tests of a package included."""
    folder = ROOT / name
    return sorted(path for kind in ('py', 'md') for path in folder.rglob(f'*.{kind}'))


def count(name: str) -> tuple[int, int]:
    """Return the words and the hard clauses of a package or folder."""
    texts = [text for path in files_of(name) for _, text in prose_of(path)]
    words = sum(len(text.split()) for text in texts)
    return words, sum(len(HARD.findall(text)) for text in texts)


def _show(name: str) -> None:
    for path in files_of(name):
        for line, text in prose_of(path):
            for offset, part in enumerate(text.splitlines()):
                if HARD.search(part):
                    print(f'{path.relative_to(ROOT)}:{line + offset}: {part.strip()}')


def main() -> None:
    """Print a table of all packages, or every clause of those named on the command line."""
    for name in sys.argv[1:]:
        _show(name)
    for name in sys.argv[1:] or packages():
        words, clauses = count(name)
        rate = 1000 * clauses / max(words, 1)
        print(f'{name:22} {words:7} words {clauses:5} clauses {rate:6.1f} /1000')


if __name__ == '__main__':
    main()
