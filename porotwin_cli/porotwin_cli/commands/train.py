"""./porotwin train: COSTA from recordings."""

from pathlib import Path
from typing import Annotated

import typer

from porotwin_cli.terminal import Json, print_json, refuse_existing, say


def command(
    recordings: Annotated[list[Path], typer.Argument(help='Experiment folders or MCAP bags.')],
    rig: Annotated[Path, typer.Option(help='rig.yaml of the physics-based model to correct.')],
    output: Annotated[Path, typer.Option(help='File for the model.')],
    grid: Annotated[
        str, typer.Option(help='Columns x rows, such as 187x112. Default: cells of 5 mm.')
    ] = '',
    preset: Annotated[
        str, typer.Option(help='Preset of the model to correct: fast, accurate or upwind.')
    ] = 'fast',
    architecture: Annotated[
        str, typer.Option(help="Network, such as local. Default: the paper's.")
    ] = '',
    epochs: Annotated[
        int, typer.Option(help='Passes over the data. 0: as suits the network.', min=0)
    ] = 0,
    seed: Annotated[int, typer.Option(help='Seed of the weights and of the sample order.')] = 7,
    as_json: Json = False,
) -> None:
    """Train COSTA on the errors of the physics-based model.

    The model learns from recordings how far the physics-based model is off after each time step.

    Example: ./porotwin train run1 run2 --rig rig.yaml --output models/monday
    """
    import numpy as np

    from porotwin_cli.costa_data import dataset_of, frames_of, open_all, train_with_progress
    from porotwin_cli.grids import grid_of, tell_cost
    from porotwin_core.rig import load_rig
    from porotwin_costa.networks import architecture as named
    from porotwin_solver.prediction_cost import prediction_cost

    refuse_existing(output)
    network = named(architecture)
    description = load_rig(rig)
    cells = grid_of(grid, description)
    experiments = [frames_of(recording, cells) for recording in open_all(recordings, description)]
    steps = np.concatenate([np.diff(frames.times) for frames in experiments])
    time_step = float(np.median(steps))
    cost = prediction_cost(description, cells, preset=preset, duration=time_step)
    tell_cost(cost, f'{len(steps)} predictions for the training pairs', len(steps))
    dataset = dataset_of(experiments, description, grid=cells, time_step=time_step, preset=preset)
    say(dataset.summary)
    model = train_with_progress(dataset, network, epochs=epochs, seed=seed)
    model.save(output)
    if as_json:
        print_json({'output': output, **model.provenance})
    else:
        explained = 1 - model.provenance['unexplained_share']
        print(f'{output}: explains {explained:.0%} of the residual on the validation pairs')
