"""The words of the report: templates beside the records that they speak of.

`page.html` is the page. Each macro of a `.txt.j2` is one text: its line breaks are spaces, and a
line that begins with `- ` begins a line of the text.
"""

import re
from collections.abc import Mapping
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape

from porotwin_core.basis import units
from porotwin_diagnosis import thresholds
from porotwin_diagnosis.data.error_parts import in_words
from porotwin_diagnosis.report import wording
from porotwin_solver.effects import EFFECTS
from porotwin_solver.effects.definition import words
from porotwin_solver.service import effects_in_force

TEMPLATES = Environment(
    loader=PackageLoader('porotwin_diagnosis', 'report'),
    autoescape=select_autoescape(),
    undefined=StrictUndefined,
)
TEMPLATES.globals.update(effects=EFFECTS, limits=thresholds)
TEMPLATES.filters.update(
    closed=wording.closed,
    effects_in_words=effects_in_force.in_words,
    error_parts=in_words,
    in_unit=wording.value,
    inputs=wording.inputs,
    meaning=lambda row: wording.phrase(row['name'], row['parameters']),
    number=words.number,
    origin=wording.origin,
    percent=wording.percent,
    spoken=wording.spoken,
    spoken_label=wording.spoken_label,
    whole_percent=units.percent,
)


def said(template: str, part: str, facts: Mapping[str, Any]) -> str:
    """Return the text that the macro `part` of `template` makes of `facts`."""
    text = getattr(TEMPLATES.get_template(template).make_module(dict(facts)), part)()
    lines = re.split(r'^ *- ', text, flags=re.MULTILINE)
    return '\n'.join(filter(None, (re.sub(r'[ \n]+', ' ', line).strip() for line in lines)))
