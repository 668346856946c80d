"""./porotwin evaluate: the errors of predictions with and without COSTA."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from porotwin_cli.terminal import Json, print_json, say
from porotwin_core.basis.errors import InputError, check_writable, refuse_file
from porotwin_core.model.preset_names import PRESET_WORDS


def command(
    model: Annotated[Path, typer.Argument(help='COSTA model to evaluate.')],
    recordings: Annotated[list[Path], typer.Argument(help='Experiment folders or MCAP bags.')],
    rig: Annotated[
        Path | None,
        typer.Option(help='rig.yaml of the physics-based model. Default: from the recording.'),
    ] = None,
    preset: Annotated[
        str, typer.Option(help=f'Preset of the physics-based model: {PRESET_WORDS}.')
    ] = 'fast',
    effect: Annotated[
        list[str], typer.Option(help='Effect of the physics-based model, as in its training.')
    ] = [],  # noqa: B006 (typer reads the default once)
    reference: Annotated[
        list[Path] | None,
        typer.Option(
            help='NetCDF file of maps that take the place of the observed ones in the errors, such '
            'as truth.nc of the demo or of rehearse --truth. One for each recording.'
        ),
    ] = None,
    output: Annotated[
        Path | None, typer.Option(help='Folder for a table, maps and pictures.')
    ] = None,
    as_json: Json = False,
) -> None:
    """Compare predictions with and without COSTA to recordings.

    Errors are relative to the observed maps, one step ahead and free-running. These maps have noise
    themselves; --reference names better ones. The output holds the observed maps and both free
    runs.

    Example: ./porotwin evaluate models/monday run3 --output evaluation

    Example: ./porotwin evaluate models/monday rehearsed --reference truth.nc
    """
    from contextlib import nullcontext

    from porotwin_cli.options.given_effects import given_effects
    from porotwin_cli.recorded.costa_data import (
        frames_of,
        open_all,
        references_of,
        source_name,
    )
    from porotwin_cli.recorded.evaluated_maps import EvaluatedMaps
    from porotwin_core.model.learnt_physics import LearntPhysics
    from porotwin_core.rig import load_rig
    from porotwin_costa.correction.corrective_model import CorrectiveModel
    from porotwin_costa.correction.corrective_source import LearntStep, corrective_source
    from porotwin_costa.evaluation.evaluation import evaluate
    from porotwin_costa.evaluation.evaluation_pictures import write_pictures
    from porotwin_solver.adjoint.learnt_coefficients import LearntModels

    if output is not None:
        refuse_file(output, 'table, maps and pictures')
        check_writable(output)
    learned = CorrectiveModel.load(model)
    experiments = open_all(recordings, load_rig(rig) if rig is not None else None)
    for recording in experiments:
        nominal = recording.rig.with_effects(given_effects(effect, recording.rig))
        try:
            learned.for_physics(nominal, learned.grid, preset)
        except InputError as error:
            raise InputError(f'{recording.source}: {error}') from None
    if learned.doubt:
        say(f'{model}: {learned.doubt}')
    say(learned.summary)
    for recording in experiments:
        if source_name(recording) in learned.provenance['sources']:
            say(f'{recording.source}: the model learned from it; expect larger errors on others')
    better = references_of(reference or [], experiments, learned.grid)
    solver = LearntModels(nominal, learned.grid, preset)
    physics = solver.model(LearntPhysics())
    step = None if learned.learnt is None else LearntStep(learned.learnt, solver)
    if output is not None:
        output.mkdir(parents=True, exist_ok=True)
        maps = EvaluatedMaps(output, learned.grid, len(experiments))
    with nullcontext() if output is None else maps as written:
        result = evaluate(
            [frames_of(recording, learned.grid) for recording in experiments],
            time_step=learned.time_step,
            predict=physics.predict,
            correct=physics.correct,
            correction=partial(corrective_source, learned, physics=step),
            references=better,
            see=(lambda _: None) if written is None else written.see,
        )
    if output is not None:
        result.write_csv(output / 'errors.csv')
        write_pictures(result, learned.grid, output)
        say(f'table, maps and pictures: {output}')
    if as_json:
        names = ('predicted', 'corrected', 'free_predicted', 'free_corrected')
        means = {name: result.mean(name) for name in names}
        print_json({**means, 'recordings': result.by_recording()})
    else:
        print(result.table())
