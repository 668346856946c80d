"""Writes docs/rig.schema.json, the JSON Schema of rig.yaml, from the sections of the description.

Run it after a change of a key: .venv/bin/python docs/make_rig_schema.py
"""

import json
from pathlib import Path

from porotwin_core.rig.known_keys import json_schema

FILE = Path(__file__).with_name('rig.schema.json')


def text() -> str:
    """Return the content of the file."""
    return json.dumps(json_schema(), indent=1, ensure_ascii=False) + '\n'


if __name__ == '__main__':
    FILE.write_text(text(), encoding='utf-8')
