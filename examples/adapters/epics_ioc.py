"""Serve the setpoints and errors of a running twin as EPICS process variables.

    pip install caproto
    python examples/adapters/epics_ioc.py myrig/rig.yaml PTWIN:

`caproto-get PTWIN:control1_ml_h` then tells a rate. The variables are read-only, and only
programs on this machine see them; an address of it as a third argument serves its network.
"""

import asyncio
import math
import sys
from collections.abc import Mapping
from pathlib import Path

from caproto import AccessRights, ChannelDouble
from caproto.asyncio.server import start_server
from twin_numbers import follow_twin, units_of

INTERVAL_S = 0.5
"""Time between two looks at the numbers [s]."""


class Number(ChannelDouble):
    """A variable that no client writes."""

    def check_access(self, *_client: str) -> AccessRights:
        """Return the rights of every client."""
        return AccessRights.READ


def channels(units: Mapping[str, str]) -> dict[str, Number]:
    """Return a variable for each number, with its unit."""
    return {name: Number(value=math.nan, units=unit, precision=3) for name, unit in units.items()}


async def serve(
    newest: Mapping[str, float], made: Mapping[str, Number], prefix: str, interface: str
) -> None:
    """Serve the `newest` numbers until cancelled."""

    async def update(_: object) -> None:
        told: dict[str, float] = {}
        while True:
            for name, channel in made.items():
                if told.get(name) is not newest[name]:
                    told[name] = newest[name]
                    await channel.write(told[name])
            await asyncio.sleep(INTERVAL_S)

    variables = {prefix + name: channel for name, channel in made.items()}
    await start_server(variables, interfaces=[interface], startup_hook=update)


def main() -> None:
    """Run until Ctrl-C."""
    rig, prefix, interface = [*sys.argv[1:], '127.0.0.1'][:3]
    node, thread = follow_twin(Path(rig))
    try:
        asyncio.run(serve(node.newest, channels(units_of(Path(rig))), prefix, interface))
    finally:
        thread.end()


if __name__ == '__main__':
    main()
