"""Ends the program with one line if a library is too old."""

import sys

import pydantic

from porotwin_core.basis.parent import REFUSAL, WRONG_PARAMETERS

OLDEST_PYDANTIC = (2, 5)
"""Oldest pydantic whose validation rig.yaml can use; Ubuntu 24.04 has 1.10."""

if tuple(int(part) for part in pydantic.VERSION.split('.')[:2]) < OLDEST_PYDANTIC:
    print(
        f'{REFUSAL}pydantic {pydantic.VERSION} is too old, 2.5 is the oldest that works; install '
        'a newer one: pip install -r setup/ros_machine.txt',
        file=sys.stderr,
    )
    sys.exit(WRONG_PARAMETERS)
