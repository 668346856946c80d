"""./porotwin confirm: a person has set the pumps."""

from typing import Annotated

import typer

from porotwin_cli.options.rig_choice import Domain, Namespace
from porotwin_core.ros.ros_environment import enter_domain, namespace_of
from porotwin_hub.launching.graph import NAMESPACE


def command(
    setpoint: Annotated[
        int, typer.Argument(help='Number of the newest setpoint.', min=1, max=2**64 - 1)
    ],
    namespace: Namespace = NAMESPACE,
    domain: Domain = None,
) -> None:
    """Tell the running twin that the pumps are set as its newest setpoint asks.

    The page does the same, and takes other rates too.

    Example: ./porotwin confirm 12
    """
    from porotwin_cli.running.live_confirmation import confirm

    enter_domain(domain)
    confirm(setpoint, namespace=namespace_of(namespace))
    print(f'setpoint {setpoint}: confirmed')
