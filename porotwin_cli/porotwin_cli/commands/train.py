"""./porotwin train: COSTA from recordings."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from porotwin_cli.options.crew_options import Scheduler, Workers
from porotwin_cli.options.seed_option import seed_option
from porotwin_cli.terminal import Json, print_json, refuse_existing, say
from porotwin_core.basis.errors import InputError
from porotwin_core.model.preset_names import PRESET_WORDS

PAIRS_KEPT = 300
"""Most pairs that are kept beside a model for training beside the twin; 8 B a cell and pair."""


def command(
    recordings: Annotated[list[Path], typer.Argument(help='Experiment folders or MCAP bags.')],
    rig: Annotated[Path, typer.Option(help='rig.yaml of the physics-based model to correct.')],
    output: Annotated[Path, typer.Option(help='File for the model.')],
    grid: Annotated[
        str, typer.Option(help='Columns x rows, such as 187x112. Default: cells of 5 mm.')
    ] = '',
    preset: Annotated[
        str, typer.Option(help=f'Preset of the model to correct: {PRESET_WORDS}.')
    ] = 'fast',
    architecture: Annotated[
        str, typer.Option(help='hybrid (default), local, paper or paper-complex.')
    ] = '',
    epochs: Annotated[
        int, typer.Option(help='Passes over the data. 0: default of the network.', min=0)
    ] = 0,
    seed: Annotated[int, seed_option('Seed of the weights and of the sample order.')] = 7,
    effect: Annotated[
        list[str], typer.Option(help='Effect of the model to correct, as NAME:PARAM=VALUE,...')
    ] = [],  # noqa: B006 (typer reads the default once)
    workers: Workers = None,
    scheduler: Scheduler = '',
    as_json: Json = False,
) -> None:
    """Train COSTA on the errors of the physics-based model.

    COSTA learns the errors of free runs of the physics-based model: first missing physics, then
    fluxes for the remaining error. A part of the recordings is held out. Free runs over this part
    decide how much of the correction is applied.

    Example: ./porotwin train run1 run2 --rig rig.yaml --output models/monday
    """
    import numpy as np

    from porotwin_checks.all_checks import OF_MAPS, OF_RIG
    from porotwin_cli.options.given_effects import given_effects
    from porotwin_cli.options.grids import grid_of, tell_cost
    from porotwin_cli.recorded.costa_data import (
        CorrectedModel,
        account_of,
        dataset_of,
        frames_of,
        open_all,
        train_on_runs,
    )
    from porotwin_core.rig import load_rig
    from porotwin_costa.data.dataset import newest, pairs_beside
    from porotwin_costa.networks import architecture as named
    from porotwin_costa.training.data_parallel import joined
    from porotwin_costa.training.run_training import TrainingChoice
    from porotwin_recording.experiment.recording import odd_lines
    from porotwin_solver.model.prediction_cost import prediction_cost

    refuse_existing(output)
    network = named(architecture)
    bare = load_rig(rig)
    description = bare.with_effects(given_effects(effect, bare))
    cells = grid_of(grid, description)
    opened = [replace(one, rig=description) for one in open_all(recordings, bare)]
    for line in odd_lines(opened, OF_MAPS | OF_RIG):
        say(line)
    steps = np.concatenate([np.diff(recording.times) for recording in opened])
    if not steps.size:
        raise InputError(
            f'{recordings[0]}: holds one map, and COSTA learns from one map to the next; name '
            'recordings with more'
        )
    time_step = float(np.median(steps))
    cost = prediction_cost(description, cells, preset=preset, duration=time_step)
    tell_cost(cost, f'{len(steps)} predictions for the training pairs', len(steps))
    corrected = CorrectedModel(description, cells, preset, time_step)
    with joined() as writes:
        model = train_on_runs(
            opened,
            corrected,
            TrainingChoice(network, seed, epochs),
            workers=workers,
            scheduler=scheduler,
        )
    if not writes:
        return
    model.save(output)
    experiments = [frames_of(recording, cells) for recording in opened]
    pairs = dataset_of(experiments, corrected)
    newest(pairs, PAIRS_KEPT).save(pairs_beside(output))
    account = account_of(model, experiments, bare, corrected)
    if as_json:
        learnt = None if model.learnt is None else model.learnt.description()
        print_json(
            {'output': output, 'learnt_physics': learnt, 'account': account, **model.provenance}
        )
    else:
        print('\n'.join([f'{output}: {model.provenance["gate"]["says"]}', *account['says']]))
