"""Converts recordings between experiment folders and bags, with progress and a summary."""

from collections.abc import Callable
from pathlib import Path

from porotwin_cli.terminal import print_json, progress, refuse_existing, refuse_inside, say

ConvertFn = Callable[..., object]
"""Converts (source, target); calls its argument `progress` with the steps done and their total."""


def convert(work: ConvertFn, source: Path, target: Path, *, as_json: bool) -> None:
    """Convert `source` into `target` and print the numbers of maps and photographs.

    Raises:
        InputError: `target` exists or lies inside `source`, or `source` is no recording.
    """
    from porotwin_checks.all_checks import OF_MAPS, OF_RIG
    from porotwin_recording.experiment.recording import odd_lines, open_recording

    refuse_existing(target)
    refuse_inside(source, target)
    with progress() as bar:
        task = bar.add_task('converting', total=None)
        work(
            source,
            target,
            progress=lambda done, total: bar.update(task, completed=done, total=total),
        )
    made = open_recording(target)
    for line in odd_lines([made], OF_MAPS | OF_RIG):
        say(line)
    maps, photographs = len(made.maps) if made.maps is not None else 0, len(made.photos)
    if as_json:
        print_json({'output': target, 'maps': maps, 'photographs': photographs})
    else:
        print(f'{target}: {maps} maps, {photographs} photographs')
