"""./porotwin diagnose: the gap between model and rig, in recordings or in the run so far."""

import math
import signal
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from porotwin_cli.options.crew_options import Scheduler, Workers
from porotwin_cli.options.rig_choice import Domain, Namespace
from porotwin_cli.terminal import (
    Json,
    WorkFailed,
    duration_in_words,
    print_json,
    print_table,
    progress,
    say,
)
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.json_text import json_value
from porotwin_core.basis.units import percent
from porotwin_core.model.preset_names import FREE_PRESET_WORDS
from porotwin_core.ros.foreign_words import in_short
from porotwin_core.ros.ros_environment import enter_domain, namespace_of
from porotwin_hub.launching.graph import NAMESPACE

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from types import FrameType
    from typing import Any

    from rich.progress import Progress as Bar

    from porotwin_cli.checking.rig_past import RigPast
    from porotwin_core.rig import Rig
    from porotwin_diagnosis.decision.verdict import Verdict
    from porotwin_diagnosis.progress import Progress, WorkClock
    from porotwin_recording.experiment.recording import Recording


def command(
    output: Annotated[Path, typer.Option(help='Folder for report, diagnosis.json and fields.nc.')],
    recordings: Annotated[
        list[Path] | None, typer.Argument(help='Experiment folders or MCAP bags of one rig.')
    ] = None,
    live: Annotated[
        bool, typer.Option('--live', help='Diagnose the run so far of the running twin.')
    ] = False,
    rig: Annotated[
        Path | None, typer.Option(help='rig.yaml of the model. Default: from the recording.')
    ] = None,
    preset: Annotated[
        str, typer.Option(help=f'Preset of the model: {FREE_PRESET_WORDS}.')
    ] = 'accurate',
    apply: Annotated[
        bool, typer.Option(help='Also write a rig.yaml with the effects found.')
    ] = False,
    history: Annotated[
        Path | None,
        typer.Option(
            help='Folder of earlier findings on this rig, the starting belief; adds the new one.'
        ),
    ] = None,
    date: Annotated[
        str,
        typer.Option(
            help='Day of the recording for --history, such as 2026-11-23. Default: from its files.'
        ),
    ] = '',
    namespace: Namespace = NAMESPACE,
    domain: Domain = None,
    each: Annotated[
        bool,
        typer.Option(
            '--each',
            help='Diagnose each recording alone, with reports in OUTPUT/NAME. '
            'A second call continues.',
        ),
    ] = False,
    quick: Annotated[
        bool, typer.Option('--quick', help='Try single effects only, no pairs of them.')
    ] = False,
    workers: Workers = None,
    scheduler: Scheduler = '',
    as_json: Json = False,
) -> None:
    """Find the cause of the gap between model and rig.

    The diagnosis finds where the gap arises, which effect causes it, and how much of it closes with
    this effect. Several recordings of one rig are diagnosed together, or with --each one by one.
    The report is a page with pictures. Ctrl-C or SIGTERM ends the search with a preliminary report
    on the answer so far; the same command goes on. With --live the running twin makes the report
    while it works.

    Example: ./porotwin diagnose runs/monday --output monday-diagnosis

    Example: ./porotwin diagnose runs/tuesday --output tuesday-diagnosis --history rig-history

    Example: ./porotwin diagnose runs/* --each --output archive --scheduler tcp://head:8786
    """
    from porotwin_cli.checking.rig_past import RigPast
    from porotwin_cli.recorded.given_twice import refuse_twice
    from porotwin_core.basis.parallel import crew
    from porotwin_core.rig import load_rig
    from porotwin_diagnosis.examine import (
        SIMULATION_BYTES,
        DiagnosisSettings,
        examine,
        untried_lines,
    )
    from porotwin_diagnosis.history.joint_belief import prior_from
    from porotwin_diagnosis.kept_simulations import FOLDER, KeptSimulations
    from porotwin_diagnosis.report.answer import sentence
    from porotwin_diagnosis.report.origin import check_unchanged, files_mark
    from porotwin_diagnosis.report.report_folder import checked_folder, write_diagnosis
    from porotwin_recording.experiment.recording import open_recording
    from porotwin_recording.tables.one_writer import only_writer
    from porotwin_solver.model.presets import free_run_preset

    if live != (not recordings):
        raise InputError('name recordings, or the running twin with --live')
    if live or recordings is None:
        asked = each or quick or workers or scheduler or date or history is not None
        if rig is not None or apply or preset != 'accurate' or asked:
            raise InputError(
                '--live diagnoses the twin as it runs; leave out --rig, --preset, --apply, --each, '
                '--quick, --history, --date, --workers and --scheduler'
            )
        enter_domain(domain)
        _live(output, namespace_of(namespace), as_json=as_json)
        return
    if date and history is None:
        raise InputError('--date: is the day of a finding in a history; name its folder, --history')
    free_run_preset(preset)  # before the folder is made
    own = load_rig(rig) if rig is not None else None
    if each:
        if apply or quick or history is not None:
            raise InputError(
                '--apply, --quick and --history belong to one diagnosis; leave out --each'
            )
        _each(recordings, output, own, preset, workers, scheduler, as_json=as_json)
        return
    marks = {recording: files_mark(recording) for recording in recordings}
    opened = [open_recording(recording, rig=own) for recording in recordings]
    refuse_twice(opened)
    past = RigPast(history, opened, date) if history is not None else None
    folder = checked_folder(output, [*recordings, *([] if rig is None else [rig])])
    for recording in opened:
        _tell_maps(recording)
    pool = crew(
        workers=workers, scheduler=scheduler, threads=True, task_bytes=SIMULATION_BYTES, tell=say
    )
    wish = Wish(quick=quick)
    with (
        only_writer(folder),
        pool,
        progress() as bar,
        wish.on_signals(),
    ):
        show = wish.beside(_shown_on(bar, quick=quick))
        simulations = KeptSimulations(pool, folder / FOLDER)
        if simulations.kept:
            say(f'going on with {simulations.kept} simulations of an interrupted call')
        settings = DiagnosisSettings(
            preset=preset,
            prior=prior_from(past.before if past else ()),
            crew=simulations,
            progress=show,
            tell=say,
            so_far=say,
            ended=wish.heard,
        )
        try:
            result = examine(opened, settings)
        except CancelledError:
            say('no effect was fitted yet, so that there is no answer')
            raise KeyboardInterrupt from None
        check_unchanged(marks)
        untried = untried_lines(result.evidence.findings)
        compare = past.compare if past else lambda _: []
        summary = write_diagnosis(result, folder, apply=apply, compare=compare, progress=show)
        if not untried:
            simulations.remove()
    told = [*summary['history'], *_remembered(past, summary)]
    if as_json:
        print_json({'output': output, **summary, 'history': told})
        return
    print(sentence(result, summary).replace('**', ''))  # with the confidence
    for line in (*told, *untried):
        print(line)
    say(f'report: {output / "report.html"}')
    _tell_about_rig(result.verdict, output, apply=apply)


def _remembered(past: 'RigPast | None', summary: 'Mapping[str, Any]') -> list[str]:
    """Add the finding in `summary` to the history, unless it is preliminary; return lines on it."""
    if past is None:
        return []
    if summary['untried']:
        return ['The history does not keep a preliminary finding.']
    return past.remember(summary)


class Wish:
    """The wish for the answer so far: Ctrl-C or SIGTERM, or, if it is `quick`, judged singles."""

    def __init__(self, *, quick: bool) -> None:
        self._quick, self._wanted = quick, False
        self._position = 0.0

    def heard(self) -> bool:
        """Return whether the search shall end."""
        from porotwin_diagnosis.progress import SINGLES_JUDGED

        return self._wanted or (self._quick and self._position >= SINGLES_JUDGED)

    def beside(self, show: 'Progress') -> 'Progress':
        """Return `show`, which also tells how far the search is."""

        def shown(stage: str, position: float) -> None:
            self._position = max(self._position, position)
            show(stage, position)

        return shown

    @contextmanager
    def on_signals(self) -> 'Iterator[None]':
        """Take the first signal of the block as the wish; a second one ends the program.

        What is ignored stays so: a background job of a shell ignores Ctrl-C.
        """

        def restore() -> None:
            for number, handler in before.items():
                signal.signal(number, handler)

        def note(_number: int, _frame: 'FrameType | None') -> None:
            restore()
            self._wanted = True
            say('the answer so far follows; a second signal ends at once')

        found = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
        before = {number: one for number, one in found.items() if one is not signal.SIG_IGN}
        for number in before:
            signal.signal(number, note)
        try:
            yield
        finally:
            restore()


def _shown_on(bar: 'Bar', *, quick: bool) -> 'Progress':
    """Return a function that shows the stages of a diagnosis on `bar`, with the time left."""
    from porotwin_diagnosis.progress import WorkClock

    number, clock = bar.add_task('diagnosis', total=100), WorkClock(quick=quick)

    def show(stage: str, position: float) -> None:
        clock.reach(position)
        bar.update(
            number,
            completed=100 * clock.share,
            left=lambda: _left_in_words(clock),
            description=stage,
        )

    return show


def _left_in_words(clock: 'WorkClock') -> str:
    """Return the time left; empty: none, or it is not known yet."""
    whole, singles = clock.left, clock.left_for_singles
    if not 0.0 < whole < math.inf:
        return ''
    if not 0.0 < singles < whole:
        return f'at most {duration_in_words(whole)}'
    return (
        f'single effects in at most {duration_in_words(singles)}, all in {duration_in_words(whole)}'
    )


def _tell_about_rig(verdict: 'Verdict', output: Path, *, apply: bool) -> None:
    """Tell how the effects of `verdict` reach the twin, or what `apply` has written."""
    from porotwin_diagnosis.thresholds import OPEN_CONFIDENCE
    from porotwin_solver.effects import EFFECTS

    camera = ' and '.join(name for name in verdict.members if EFFECTS[name].is_of_camera)
    if not verdict.model.effects or not verdict.members:
        if apply:
            say(f'{output / "rig.yaml"} repeats the description: the verdict names no effect')
    elif not apply:
        if camera:
            say(f'{camera}: an effect of the camera; correct it at the camera')
        elif verdict.confidence > OPEN_CONFIDENCE:
            say(
                'the same call with --apply diagnoses again, and also writes a rig.yaml with the '
                'effect, for ./porotwin up --rig'
            )
    else:
        say(f'{output / "rig.yaml"}: the rig with {" and ".join(verdict.members)}')
        if verdict.confidence <= OPEN_CONFIDENCE:
            say(f'the confidence is only {percent(verdict.confidence)}: check before you use it')
        for names in verdict.alternatives:
            say(f'{" and ".join(names)} fits equally well: check before you use it')
        if verdict.not_separable:
            say(f'it leaves out what looks the same: {" and ".join(verdict.not_separable)}')
        if camera:
            say(
                f'{camera}: an effect of the camera. It is in rig.yaml, so that the next diagnosis '
                'expects it. The running twin does not correct its maps for it: correct the camera'
            )


def _tell_maps(recording: 'Recording') -> None:
    """Tell which maps of `recording` are read."""
    maps = recording.present_maps
    say(f'{recording.source}: {len(maps)} maps, {maps.origin.in_words}')


def _each(
    recordings: list[Path],
    output: Path,
    rig: 'Rig | None',
    preset: str,
    workers: int | None,
    scheduler: str,
    *,
    as_json: bool,
) -> None:
    """Diagnose every recording alone and print a table."""
    from porotwin_checks.all_checks import OF_MAPS, OF_RIG
    from porotwin_core.basis.parallel import crew
    from porotwin_diagnosis.archive import RECORDING_BYTES, archive_tasks, diagnose_archive
    from porotwin_recording.experiment.recording import odd_lines, open_recording
    from porotwin_recording.tables.one_writer import only_writer

    tasks = archive_tasks(recordings, output, rig=rig, preset=preset)
    left = sum(not task.is_done for task in tasks)
    pool = crew(
        workers=workers,
        scheduler=scheduler,
        threads=not left,  # no processes for nothing
        task_bytes=RECORDING_BYTES,
        tell=say,
    )
    with only_writer(output), pool, progress() as bar:
        shown = bar.add_task('recordings', total=len(tasks), completed=len(tasks) - left)
        table = diagnose_archive(tasks, output, pool, lambda _: bar.advance(shown))
    for task in tasks:
        with suppress(InputError):  # the table tells why it is refused
            recording = open_recording(task.recording, rig=task.rig)
            _tell_maps(recording)
            for line in odd_lines(
                [recording], OF_MAPS | OF_RIG
            ):  # a refused recording has no report with them
                say(line)
    if as_json:
        print_json({'output': output, 'recordings': table})
    else:
        rows = [[Path(row['recording']).name, *_verdict_words(row)] for row in table]
        print_table('archive', ('recording', 'verdict', 'confidence'), rows)
    refused = [row for row in table if row['refused']]
    for row in refused:
        say(row['refused'])
    if refused:
        raise WorkFailed(f'{output}: {len(refused)} of {len(table)} recordings were refused')


def _verdict_words(row: dict[str, object]) -> tuple[str, str]:
    from porotwin_diagnosis.report.named_rows import verdict_words

    return ('refused', '') if row['refused'] else (verdict_words(row), str(row['confidence']))


def _live(output: Path, namespace: str, *, as_json: bool) -> None:
    """Print the diagnosis of the run so far."""
    from porotwin_cli.running.live_diagnosis import diagnose_run_so_far
    from porotwin_diagnosis.report.named_rows import verdict_words

    with progress() as bar:
        result = diagnose_run_so_far(output, _shown_on(bar, quick=False), namespace=namespace)
    summary = json_value((output / 'diagnosis.json').read_text())
    if as_json:
        print_json({'output': output, **summary})
        return
    print(f'{verdict_words(summary)}, with confidence {100 * result.confidence:.0f} %')
    say(f'report: {in_short(result.report)}')
