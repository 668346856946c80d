"""./porotwin evaluate: the errors of predictions with and without COSTA."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from porotwin_cli.terminal import Json, print_json, say


def command(
    model: Annotated[Path, typer.Argument(help='COSTA model to evaluate.')],
    recordings: Annotated[list[Path], typer.Argument(help='Experiment folders or MCAP bags.')],
    rig: Annotated[
        Path | None,
        typer.Option(help='rig.yaml of the physics-based model. Default: from the recording.'),
    ] = None,
    preset: Annotated[
        str, typer.Option(help='Preset of the physics-based model: fast, accurate or upwind.')
    ] = 'fast',
    output: Annotated[Path | None, typer.Option(help='Folder for a table and pictures.')] = None,
    as_json: Json = False,
) -> None:
    """Compare predictions with and without COSTA to recordings.

    Errors are relative to the observed maps, one step ahead and free-running.

    Example: ./porotwin evaluate models/monday run3 --output evaluation
    """
    from porotwin_cli.costa_data import frames_of, open_all, source_name
    from porotwin_core.rig import load_rig
    from porotwin_costa.corrective_model import CorrectiveModel
    from porotwin_costa.corrective_source import corrective_source
    from porotwin_costa.evaluation import evaluate
    from porotwin_costa.evaluation_pictures import write_pictures
    from porotwin_solver.model import Model

    learned = CorrectiveModel.load(model)
    experiments = open_all(recordings, load_rig(rig) if rig is not None else None)
    nominal = experiments[0].rig
    learned.for_physics(nominal, learned.grid, preset)
    if learned.doubt:
        say(f'{model}: {learned.doubt}')
    for recording in experiments:
        if source_name(recording) in learned.provenance['sources']:
            say(f'{recording.source}: the model learned from it; expect larger errors on others')
    physics = Model(nominal, learned.grid, preset=preset)
    result = evaluate(
        [frames_of(recording, learned.grid) for recording in experiments],
        time_step=learned.time_step,
        predict=physics.predict,
        correct=physics.correct,
        correction=partial(corrective_source, learned),
    )
    if output is not None:
        output.mkdir(parents=True, exist_ok=True)
        result.write_csv(output / 'errors.csv')
        write_pictures(result, learned.grid, output)
        say(f'table and pictures: {output}')
    if as_json:
        names = ('predicted', 'corrected', 'free_predicted', 'free_corrected')
        print_json({name: result.mean(name) for name in names})
    else:
        print(result.table())
