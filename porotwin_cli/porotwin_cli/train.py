"""./porotwin train: COSTA from recordings."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from porotwin_cli.output import Json, print_json, progress, refuse_existing, say
from porotwin_core.grid import Grid
from porotwin_core.rig import load_rig


def command(
    recordings: Annotated[list[Path], typer.Argument(help='Experiment folders or MCAP bags.')],
    rig: Annotated[Path, typer.Option(help='rig.yaml of the physics-based model to correct.')],
    output: Annotated[Path, typer.Option(help='Folder for the model.')],
    grid: Annotated[str, typer.Option(help='Columns x rows; default: cells of 5 mm.')] = '',
    preset: Annotated[str, typer.Option(help='Scheme to correct: fast, upwind ...')] = 'fast',
    architecture: Annotated[str, typer.Option(help='Named network.')] = '',
    epochs: Annotated[int, typer.Option(help='Passes over the data; 0: the default.')] = 0,
    seed: Annotated[int, typer.Option(help='Of the weights and the order of samples.')] = 7,
    as_json: Json = False,
) -> None:
    """Train the corrective source term on what the physics-based model missed.

    Example: ./porotwin train run1 run2 --rig rig.yaml --output models/monday
    """
    from porotwin_cli.costa_data import dataset_of, frames_of, open_all
    from porotwin_costa.architectures import training_settings
    from porotwin_costa.training import TrainingProgress, train

    refuse_existing(output)
    description = load_rig(rig)
    on = (
        Grid.parse(grid, description.width_m, description.height_m)
        if grid
        else description.default_grid()
    )
    experiments = [frames_of(recording, on) for recording in open_all(recordings, description)]
    steps = np.concatenate([np.diff(frames.times) for frames in experiments])
    time_step = float(np.median(steps))
    dataset = dataset_of(experiments, description, grid=on, time_step=time_step, preset=preset)
    say(dataset.summary)
    settings = training_settings(architecture, epochs=epochs)
    with progress() as bar:
        task = bar.add_task('training', total=settings.epochs)

        def on_epoch(state: TrainingProgress) -> None:
            bar.update(
                task,
                completed=state.epoch,
                description=f'training, loss {state.validation_loss:.3f}',
            )

        model = train(dataset, settings, seed=seed, progress=on_epoch)
    model.save(output)
    if as_json:
        print_json({'output': output, **model.provenance})
    else:
        left = model.provenance['unexplained_share']
        print(f'{output}: explains {1 - left:.0%} of the residual on pairs kept aside')
