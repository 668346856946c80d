"""The files of the page: HTML with the panels' declarations, style sheet and scripts."""

import functools
import json
from collections.abc import Mapping
from importlib import resources

from porotwin_page.panel import Panel

CONTENT_TYPES = {'.js': 'text/javascript', '.css': 'text/css'}
"""Types of the files that are served, by suffix."""

_NO_DECLARATIONS = 'id="declarations">[]<'


def document(panels: Mapping[str, Panel]) -> str:
    """Return the page as HTML with the declarations of `panels`, by name, as a JSON block."""
    declarations = [{'name': name} | panel.declaration() for name, panel in panels.items()]
    # the sequence </script> in a text would end the block
    text = json.dumps(declarations).replace('<', '\\u003c')
    page = (resources.files('porotwin_page') / 'web' / 'page.html').read_text(encoding='utf-8')
    return page.replace(_NO_DECLARATIONS, f'id="declarations">{text}<')


@functools.cache
def web_files() -> dict[str, tuple[str, str]]:
    """Return (text, content type) of scripts and style sheet by path: folder/name."""
    files: dict[str, tuple[str, str]] = {}
    for folder in ('web', 'panels'):
        for file in (resources.files('porotwin_page') / folder).iterdir():
            suffix = f'.{file.name.rpartition(".")[2]}'
            if suffix in CONTENT_TYPES:
                text = file.read_text(encoding='utf-8')
                files[f'{folder}/{file.name}'] = (text, CONTENT_TYPES[suffix])
    return files
