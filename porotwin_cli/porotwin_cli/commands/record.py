"""./porotwin record: all messages of a running graph into a bag."""

from pathlib import Path
from typing import Annotated

import typer

from porotwin_cli.options.rig_choice import Domain, Namespace
from porotwin_cli.running.foreground import run_node
from porotwin_cli.terminal import Json, print_json, refuse_existing, say
from porotwin_hub.launching.graph import NAMESPACE


def command(
    output: Annotated[Path, typer.Option(help='Bag folder to write.')],
    split_mb: Annotated[
        float, typer.Option(help='Begin a new file after this size [MB]. 0: one file.', min=0.0)
    ] = 0.0,
    split_min: Annotated[
        float, typer.Option(help='Begin a new file after this time [min]. 0: one file.', min=0.0)
    ] = 0.0,
    namespace: Namespace = NAMESPACE,
    domain: Domain = None,
    as_json: Json = False,
) -> None:
    """Record the running graph until Ctrl-C.

    Example: ./porotwin record --output runs/today
    """
    from porotwin_recording.mcap.bag_reader import BagReader

    refuse_existing(output)
    say(f'recording into {output}; stop with Ctrl-C')
    run_node(
        'porotwin_recording.recorder_node',
        'recorder',
        {'output': str(output.resolve()), 'split_mb': split_mb, 'split_s': 60.0 * split_min},
        namespace=namespace,
        domain=domain,
    )
    if not output.exists():
        raise KeyboardInterrupt  # it came before the node had begun the bag
    messages = BagReader(output).message_count
    if as_json:
        print_json({'output': output, 'messages': messages})
    else:
        print(f'{output}: {messages} messages')
