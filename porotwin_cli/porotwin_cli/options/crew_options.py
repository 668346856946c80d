"""The options of all commands that do many tasks: how many at a time, and where."""

from typing import Annotated

import typer

Workers = Annotated[
    int | None,
    typer.Option(
        min=1,
        max=1024,
        help='Tasks at a time on this machine. Default: one per core, as far as the memory holds.',
    ),
]

Scheduler = Annotated[
    str,
    typer.Option(
        metavar='TCP://HOST:PORT',
        help='Dask scheduler of a cluster that does the work instead; see docs/cluster.md.',
    ),
]
