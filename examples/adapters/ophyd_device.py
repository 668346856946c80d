"""A running twin as a device of ophyd-async, so that plans of Bluesky read its numbers.

    pip install ophyd-async bluesky

In the session of Bluesky, with the nodes of the twin on the same machine or domain:

    node, thread = follow_twin(Path('myrig/rig.yaml'))
    with init_devices():
        twin = Twin(node.newest, units_of(Path('myrig/rig.yaml')))
    RE(count([twin], num=10, delay=30.0))
"""

from collections.abc import Mapping
from functools import partial

from ophyd_async.core import (
    StandardReadable,
    StandardReadableFormat,
    soft_signal_r_and_setter,
)


class Twin(StandardReadable):
    """Has a read-only signal of each number, named as in `twin_numbers`."""

    def __init__(
        self, newest: Mapping[str, float], units: Mapping[str, str], name: str = ''
    ) -> None:
        """Read from `newest`, which another thread keeps new."""
        # a cached signal would tell its first value for ever
        with self.add_children_as_readables(StandardReadableFormat.HINTED_UNCACHED_SIGNAL):
            for number, unit in units.items():
                take = partial(newest.__getitem__, number)
                signal, _ = soft_signal_r_and_setter(float, units=unit, getter=take)
                setattr(self, number, signal)
        super().__init__(name)
