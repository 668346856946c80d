"""The page as one document: style and script put into the HTML, so that it needs nothing else."""

import functools
from importlib import resources


@functools.cache
def document() -> str:
    """Return the page as one HTML text."""
    folder = resources.files('porotwin_page') / 'web'
    page = (folder / 'page.html').read_text(encoding='utf-8')
    for name, mark in (('page.css', '/* page.css */'), ('page.js', '/* page.js */')):
        page = page.replace(mark, (folder / name).read_text(encoding='utf-8'))
    return page
