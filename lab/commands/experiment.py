"""./porotwin experiment: the experiments of the paper, with their figures."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from porotwin_cli.options.seed_option import seed_option
from porotwin_cli.terminal import Json, print_json, print_table, say
from porotwin_cli.workspace import run_folder
from porotwin_core.basis.units import HOUR_S, LONGEST_EXPERIMENT_S, MINUTE_S


class PaperSection(StrEnum):
    """The experiments of the paper by name, and one of strangers."""

    DIFFUSIVE = 'diffusive'
    COMPLEX = 'complex'
    CONTROL = 'control'
    SEEPAGE = 'seepage'


CONTROL_MINUTES = 80.0
"""Length of the experiment of section 4 [min]."""


def command(
    name: Annotated[
        PaperSection,
        typer.Argument(
            help='diffusive (section 3.1), complex (section 3.2), control (section 4), or seepage: '
            'the sand tank of 1904.'
        ),
    ],
    output: Annotated[
        Path | None, typer.Option(help='Folder for all results. Default: in runs/.')
    ] = None,
    minutes: Annotated[
        float,
        typer.Option(
            help='Length of each diffusive or control experiment [min]. 0: as usual.',
            min=0,
            max=LONGEST_EXPERIMENT_S / MINUTE_S,
        ),
    ] = 0.0,
    hours: Annotated[
        float,
        typer.Option(
            help='complex: length of the experiment [h].',
            min=2,
            max=LONGEST_EXPERIMENT_S / HOUR_S,
        ),
    ] = 27.5,
    cell_mm: Annotated[
        float,
        typer.Option(
            help='Cells of the maps, diffusive or complex [mm]. 0: 10 or 25. Twice the size takes '
            'about an eighth of the time.',
            min=0,
            max=1000,
        ),
    ] = 0.0,
    photographs: Annotated[
        Path | None,
        typer.Option(help='seepage: folder of the photographs. Default: ../shared/data.'),
    ] = None,
    seed: Annotated[int, seed_option('Seed of the training.')] = 7,
    as_json: Json = False,
) -> None:
    """Repeat an experiment of the paper on the virtual rig, with its figures.

    diffusive: the model smears the plume and COSTA corrects it; maps at 10 and 30 min. complex: a
    large rig with layers, and a tracer denser than in the model; errors over 27.5 h. control: the
    twin keeps tracer out of a zone. The results include the paper's network beside ours. seepage:
    later photographs of a real tank are predicted from earlier ones.

    Example: ./porotwin experiment diffusive --output runs/diffusive
    """
    folder = run_folder(output, f'experiment-{name}')
    if name is PaperSection.CONTROL:
        from porotwin_cli.running.closed_loop import show_figures

        figures: dict[str, Any] = _control(folder, minutes or CONTROL_MINUTES, seed)
        if as_json:
            print_json({**figures, 'output': folder})
        else:
            show_figures(figures, folder)
        return
    if name is PaperSection.SEEPAGE:
        from lab.photographs import seepage

        there = photographs or seepage.PHOTOGRAPHS
        rows, causes = seepage.run(there, folder), seepage.causes(there)
        say(f'pictures and errors: {folder}')
        if as_json:
            found = {'experiment': str(name), 'plumes': rows, 'causes': causes, 'output': folder}
            print_json(found)
            return
        for title, table in (
            ('tips and centre lines, predicted against seen', rows),
            ('misfit of the maps to 10:55, with an effect beside the rates', causes),
        ):
            print_table(title, list(table[0]), [list(row.values()) for row in table])
        return
    from lab import paper_experiments

    makers = {
        PaperSection.DIFFUSIVE: lambda: paper_experiments.diffusive(
            minutes or 40.0, cell_mm or paper_experiments.CELL_MM
        ),
        PaperSection.COMPLEX: lambda: paper_experiments.complex_(
            hours, cell_mm or paper_experiments.LARGE_GRID_CELL_MM
        ),
    }
    rows = paper_experiments.run(makers[name], folder, seed=seed)
    _show(name, rows, folder, f'relative errors, {name}', as_json=as_json)


def _show(
    name: PaperSection, rows: list[dict[str, Any]], folder: Path, title: str, *, as_json: bool
) -> None:
    """Print the rows of an experiment, as a table or as JSON."""
    say(f'pictures and errors: {folder}')
    if as_json:
        print_json({'experiment': str(name), 'networks': rows, 'output': folder})
    else:
        print_table(title, list(rows[0]), [list(row.values()) for row in rows])


def _control(folder: Path, minutes: float, seed: int) -> dict[str, Any]:
    """Run the closed loop of the demo and return its figures."""
    from porotwin_cli.running.closed_loop import DemoSettings, run_demo
    from porotwin_core.ros.ros_environment import prepare_environment

    prepare_environment()
    settings = DemoSettings(
        minutes=minutes,
        speed='max',
        seed=seed,
        costa=True,
        preset='upwind',
        photo_width=1600,
        page='',
    )
    settings.check()
    return run_demo(settings, folder)
