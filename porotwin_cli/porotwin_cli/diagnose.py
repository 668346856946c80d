"""./porotwin diagnose: the sim-to-real gap of a recording, or of the run so far."""

import json
from pathlib import Path
from typing import Annotated

import typer

from porotwin_cli.output import Json, print_json, progress, say
from porotwin_core.errors import InputError
from porotwin_core.rig import load_rig


def command(
    output: Annotated[Path, typer.Option(help='Folder for report, diagnosis.json, fields.nc.')],
    recordings: Annotated[
        list[Path] | None, typer.Argument(help='Experiment folders or MCAP bags.')
    ] = None,
    live: Annotated[
        bool, typer.Option('--live', help='Of the run so far of the twin that is running.')
    ] = False,
    rig: Annotated[
        Path | None, typer.Option(help='rig.yaml, if not that of the recording.')
    ] = None,
    preset: Annotated[
        str, typer.Option(help='Scheme whose gap is asked for: accurate, fast or upwind.')
    ] = 'accurate',
    apply: Annotated[
        bool, typer.Option(help='Also write rig.yaml with the effects found.')
    ] = False,
    as_json: Json = False,
) -> None:
    """Say where the gap between model and rig lies, which effect causes it, how far it shrinks.

    Several recordings of the same rig are judged together. The report is a page with pictures.
    With --live the running twin is asked, which goes on meanwhile.

    Example: ./porotwin diagnose runs/monday --output monday-diagnosis
    """
    from porotwin_diagnosis.examine import examine
    from porotwin_diagnosis.model.candidate import CAMERA
    from porotwin_diagnosis.report.report_folder import checked_folder, write_diagnosis
    from porotwin_recording.recording import open_recording

    if live != (not recordings):
        raise InputError('name recordings, or the running twin with --live')
    if live or recordings is None:
        if rig is not None or apply or preset != 'accurate':
            raise InputError(
                '--live judges the twin as it runs; leave out --rig, --preset and --apply'
            )
        _live(output, as_json=as_json)
        return
    own = load_rig(rig) if rig is not None else None
    opened = [open_recording(recording, rig=own) for recording in recordings]
    folder = checked_folder(output, recordings)
    with progress() as bar:
        task = bar.add_task('diagnosis', total=100)

        def show(stage: str, fraction: float) -> None:
            bar.update(task, completed=round(100 * fraction), description=stage)

        result = examine(opened, preset=preset, progress=show)
        summary = write_diagnosis(result, folder, apply=apply, progress=show)
    if as_json:
        print_json({'output': output, **summary})
        return
    print(f'{summary["verdict"]}, with confidence {summary["confidence"]:.2f}')
    say(f'read {output / "report.html"}')
    camera = ' and '.join(name for name in result.verdict.members if name in CAMERA)
    if apply and not (result.verdict.members and result.verdict.model.effects):
        say('rig.yaml is as it was: the verdict names no effect that it could hold')
    if apply and camera:
        say(
            f'{camera}: an effect of the camera. rig.yaml has it, so that a diagnosis expects it; '
            'the running twin takes its maps as they come: mend it at the camera'
        )


def _live(output: Path, *, as_json: bool) -> None:
    from porotwin_cli.live_diagnosis import diagnose_run_so_far

    with progress() as bar:
        task = bar.add_task('diagnosis', total=100)
        result = diagnose_run_so_far(
            output,
            lambda stage, share: bar.update(task, completed=round(100 * share), description=stage),
        )
    if as_json:
        print_json({'output': output, **json.loads((output / 'diagnosis.json').read_text())})
        return
    print(f'{result.verdict}, with confidence {result.confidence:.2f}')
    say(f'read {result.report}')
