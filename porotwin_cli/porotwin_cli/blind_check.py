"""./porotwin blind-check: the diagnosis on recordings whose truth it does not know."""

from pathlib import Path
from typing import Annotated

import typer

from porotwin_cli.output import Json, print_json, progress, say


def command(
    output: Annotated[Path, typer.Option(help='Folder; a second call goes on where it stopped.')],
    cases: Annotated[int, typer.Option(help='Recordings to make and diagnose.', min=1)] = 20,
    seed: Annotated[int, typer.Option(help='Of the effects and the rigs.')] = 1,
    as_json: Json = False,
) -> None:
    """Make recordings with hidden effects on the virtual rig, diagnose, score.

    The hashes of all truths are written before the first diagnosis. The diagnosing process knows
    the folder of a recording and nothing else.

    Example: ./porotwin blind-check --cases 100 --output blind
    """
    from porotwin_validation.blind_study import blind_check

    with progress() as bar:
        task = bar.add_task('cases', total=cases)
        figures = blind_check(
            output,
            cases=cases,
            seed=seed,
            progress=lambda done, _, stage: bar.update(task, completed=done, description=stage),
        )
    if as_json:
        print_json({'output': output, **figures})
        return
    print((output / 'report.md').read_text(encoding='utf-8'))
    say(f'table and confusion matrix in {output / "report.md"}')
