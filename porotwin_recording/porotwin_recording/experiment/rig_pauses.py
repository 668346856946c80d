"""The announced pauses of a rig as text: its message has no field for them.

A bag keeps the text in the metadata of the channel of `rig/description`. Other tools pass it over.
"""

import json

import pydantic

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.json_text import json_value
from porotwin_core.rig import Rig
from porotwin_core.rig.control_section import FixedWell


def pauses_text(rig: Rig) -> str:
    """Return the pauses of the fixed wells of `rig` [min] as JSON; empty: there are none."""
    fixed = rig.control.fixed if rig.control is not None else {}
    pauses = {name: well.pauses_min for name, well in fixed.items() if well.pauses_min}
    return json.dumps(pauses) if pauses else ''


def with_pauses(rig: Rig, text: str) -> Rig:
    """Return `rig` with the pauses in a `text` of `pauses_text`.

    Raises:
        InputError: the text does not fit the rig; one line.
    """
    if not text or rig.control is None:
        return rig
    fixed = dict(rig.control.fixed)
    try:
        for name, pauses in json_value(text).items():
            fixed[name] = FixedWell.model_validate({**dict(fixed[name]), 'pauses_min': pauses})
    except (ValueError, KeyError, AttributeError, pydantic.ValidationError):
        raise InputError(
            f'the pauses beside the rig description do not fit its wells: {text[:80]}; '
            'give rig.yaml beside the bag'
        ) from None
    return rig.model_copy(update={'control': rig.control.model_copy(update={'fixed': fixed})})
