"""Options that choose one of several rigs: the namespace and the domain of its nodes."""

from typing import Annotated

import typer

Namespace = Annotated[
    str, typer.Option(help='Namespace of the nodes, such as rig2; each rig has its own.')
]

Domain = Annotated[
    int | None,
    typer.Option(help='DDS domain; each rig on a network has its own. Default: ROS_DOMAIN_ID.'),
]
