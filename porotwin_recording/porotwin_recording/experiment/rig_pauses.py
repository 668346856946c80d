"""The announced pauses of a rig in bags of version 0.2, whose message of the rig had no field.

They are a text in the metadata of the channel of `rig/description`.
"""

import pydantic

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.json_text import json_value
from porotwin_core.rig import Rig
from porotwin_core.rig.control_section import FixedWell


def with_pauses(rig: Rig, text: str) -> Rig:
    """Return `rig` with the pauses [min] in a JSON `text`; empty: there are none.

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
