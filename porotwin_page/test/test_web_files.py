"""Tests of the files of the page: nothing is loaded from elsewhere, and nothing is missing."""

import json
import posixpath
import re

from porotwin_page.panel import LinesPanel, Region
from porotwin_page.panel_registry import all_panels
from porotwin_page.web_files import document, web_files


def declarations(page: str) -> list[dict]:
    found = re.search(r'id="declarations">(.*?)</script>', page, re.DOTALL)
    assert found is not None
    return json.loads(found[1])


def test_the_document_declares_all_panels() -> None:
    declared = {each['name']: each for each in declarations(document(all_panels()))}
    assert declared.keys() == all_panels().keys()
    assert declared['forecast_error']['unit'] == '%'
    assert declared['difference']['signed']


def test_a_text_cannot_end_the_block_of_declarations() -> None:
    panel = LinesPanel(title='</script>', region=Region.MAPS, order=1, lines=lambda *_: [])
    (declared,) = declarations(document({'odd': panel}))
    assert declared['title'] == '</script>'


def test_files_name_no_other_host() -> None:
    texts = [document(all_panels()), *(text for text, _ in web_files().values())]
    addresses = {found for text in texts for found in re.findall(r'https?://[^\s\'"<>)]+', text)}
    assert addresses <= {'http://www.w3.org/2000/svg'}  # a name, never fetched


def test_the_document_loads_only_files_of_the_page() -> None:
    loaded = re.findall(r'<(?:script|link)[^>]+(?:src|href)="(?!data:)([^"]+)"', document({}))
    assert loaded
    assert {path.removeprefix('/') for path in loaded} <= web_files().keys()


def test_every_imported_module_exists() -> None:
    for path, (text, _) in web_files().items():
        for target in re.findall(r"from '(\.[^']+)'", text):
            resolved = posixpath.normpath(posixpath.join(posixpath.dirname(path), target))
            assert resolved in web_files(), f'{path} imports {target}'
