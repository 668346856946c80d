"""./porotwin what-if: a proposed schedule beside the present one, from a moment of a recording."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from porotwin_cli.options.crew_options import Scheduler, Workers
from porotwin_cli.terminal import Json, print_json, print_table, progress, say
from porotwin_core.basis.errors import InputError, check_writable, refuse_file
from porotwin_core.basis.units import percent
from porotwin_core.rig.coarse_grid import COARSE_CELLS

if TYPE_CHECKING:
    from porotwin_cli.running.what_if_study import WhatIfStudy
    from porotwin_core.rates.wells import WellRate, WellRates
    from porotwin_siblings.outlook import Outlook

TABLE_ROWS = 6
"""Times in the table."""

REFUSED = 'the guard would refuse this proposal, {}'
"""Told before the work, and again below the table, with when and why."""

SIBLING_BYTES = 1e8
"""Memory of one sibling while it runs [B]."""


def command(
    recording: Annotated[Path, typer.Argument(help='Experiment folder or MCAP bag with maps.')],
    at: Annotated[
        str, typer.Option(help='Start of the proposed rates: 35min, 0.5h, 2d, or seconds.')
    ],
    rates: Annotated[
        list[str],
        typer.Option(
            help='[TIME:]WELL=ML_H,WELL=ML_H: proposed rates from TIME on, or from --at on. May be '
            'given several times. WELL=ML_H@1 injects tracer stock, @0 water; without @, a well '
            'injects what rig.yaml says. Other wells follow the present schedule. The producer '
            'balances them, unless it is named itself.'
        ),
    ],
    horizon: Annotated[
        str,
        typer.Option(
            help='Length of the forecast, such as 60min. Default: to the end of the recording, at '
            'least 30min.'
        ),
    ] = '',
    rig: Annotated[Path | None, typer.Option(help='rig.yaml. Default: from the recording.')] = None,
    siblings: Annotated[int, typer.Option(help='Number of siblings.', min=24)] = 32,
    cells: Annotated[
        int, typer.Option(help='Number of grid cells of each sibling.', min=100, max=1_000_000)
    ] = COARSE_CELLS,
    workers: Workers = None,
    scheduler: Scheduler = '',
    output: Annotated[Path, typer.Option(help='Folder for the picture.')] = Path('what-if'),
    as_json: Json = False,
) -> None:
    """Forecast other rates beside the present schedule, with 90 % bands.

    An ensemble of twins, the siblings, learns from the maps until --at and runs both schedules from
    the last map. The present schedule comes from the recording. Times are on the clock of the
    recording. Nothing is pumped.

    Example: ./porotwin what-if runs/monday/bag --at 35min --rates control1=300,control2=0

    Example: ./porotwin what-if sample --at 3min --rates control1=300 --rates 10min:control1=0
    """
    from porotwin_cli.options.output_files import check_output
    from porotwin_cli.running.what_if_picture import what_if_picture
    from porotwin_cli.running.what_if_study import rate_steps, seconds_of, study_what_if
    from porotwin_core.basis.parallel import crew
    from porotwin_recording.experiment.recording import open_recording

    if recording.suffix == '.nc':
        raise InputError(
            f'{recording}: a file of maps has no rates; give the experiment folder, with the maps '
            'as concentration.nc'
        )
    refuse_file(output, 'the picture')
    opened = open_recording(recording, rig=rig)
    start = seconds_of(at)
    steps = rate_steps(rates, opened.rig, start)
    ahead = seconds_of(horizon) if horizon else None
    picture = output / 'what_if.png'
    if output.exists():
        check_output(picture, recording, rig, command='what-if', named=False)
    else:
        check_writable(output)
    pool = crew(
        workers=workers, scheduler=scheduler, threads=True, task_bytes=SIBLING_BYTES, tell=say
    )
    with pool, progress() as bar:
        task = bar.add_task('learning from the maps', total=None)
        found = study_what_if(
            opened,
            start,
            steps,
            cells=cells,
            executor=pool,
            horizon=ahead,
            siblings=siblings,
            learnt=lambda done, all_: bar.update(task, completed=done, total=all_),
            objected=lambda line: say(REFUSED.format(line)),
        )
    output.mkdir(parents=True, exist_ok=True)  # a refused call leaves no folder
    what_if_picture(picture, found)
    if found.note:
        say(found.note)
    if as_json:
        print_json(_json(found) | {'picture': picture})
        return
    _show(found)
    print(f'picture: {picture}; nothing was pumped')
    for line in found.objections:
        print(REFUSED.format(line))


def _show(found: 'WhatIfStudy') -> None:
    """Print the rates of both plans, and their outlooks at some times."""
    import numpy as np

    from porotwin_cli.running.what_if_study import NO_ZONE, REACHED
    from porotwin_core.basis.units import ML

    unit = found.time_unit
    print('rates in ml/h; @ gives the injected concentration, 1 is tracer stock')
    for name, outlook in (('present', found.present), ('proposed', found.proposed)):
        for step in found.pumped_plan(outlook):
            moment = unit.precise(found.start + step.start)
            print(f'{name}, from {moment}: {_in_words(step.rates)}')
        if balance := found.balance(outlook.plan[-1].rates):
            print(f'{name}, water at the end, {balance}')
        if (bottle := found.bottle(outlook)) is not None:
            empty = '' if bottle.left > 0.0 else f', empty at {bottle.empty_at:.0f} s'
            print(f'{name}, stock in the bottle at the end: {bottle.left * ML:.4g} ml{empty}')
    plans = (found.present, found.proposed)
    if not found.has_zone:
        print(f'{NO_ZONE}; forecasts computed in {found.seconds:.1f} s')
        return
    rows = []
    for index in np.linspace(0, len(plans[0].times) - 1, TABLE_ROWS).round().astype(int):
        row = [f'{(found.start + plans[0].times[index]) / unit.seconds:.1f}']
        for outlook in plans:
            low, median, high = outlook.zone_tracer[:, index] * ML
            row += [
                f'{median:.2f} ({low:.2f} to {high:.2f})',
                percent(outlook.zone_reached[index]),
            ]
        rows.append(row)
    print_table(
        f'tracer in the zone [ml], median (90 % band); reached: the probability that {REACHED}',
        (f'time [{unit.name}]', 'present', 'reached', 'proposed', 'reached'),
        rows,
    )


def _in_words(rates: 'WellRates') -> str:
    from porotwin_core.basis.units import to_ml_h

    def fluid(well: 'WellRate') -> str:
        return f'@{well.concentration:.3g}' if well.rate > 0.0 and well.concentration else ''

    return ', '.join(
        f'{name} {to_ml_h(well.rate):.4g}{fluid(well)}' for name, well in rates.items()
    )


def _json(found: 'WhatIfStudy') -> dict[str, Any]:
    """Return both forecasts in laboratory units; times are on the clock of the recording."""
    from porotwin_core.basis.units import ML

    return {
        'at_s': found.start,
        'present': _outlook_json(found, found.present),
        'proposed': _outlook_json(found, found.proposed),
        'seen': {
            'times_s': found.seen_times.tolist(),
            'zone_ml': (found.seen_tracer * ML).tolist(),
            'deviation_ml': (found.seen_deviation * ML).tolist(),
            'deviations_known': found.deviations_known,
        },
        'rate_factors': {
            well: {'factor': pump.factor, 'deviation': pump.deviation}
            for well, pump in found.rate_factors.items()
        },
        'objections': list(found.objections),
        'note': found.note,
        'model_s': found.seconds,
    }


def _outlook_json(found: 'WhatIfStudy', outlook: 'Outlook') -> dict[str, Any]:
    """Return an outlook of a study."""
    start, balance = found.start, found.balance(outlook.plan[-1].rates)
    bottle = found.bottle(outlook)
    from porotwin_core.basis.units import ML, to_ml_h

    names = ('low', 'median', 'high')
    return {
        'schedule': [
            {
                'start_s': start + step.start,
                'rates_ml_h': {name: to_ml_h(well.rate) for name, well in step.rates.items()},
            }
            for step in found.pumped_plan(outlook)
        ],
        'water_at_the_end_ml_h': None if balance is None else balance.in_ml_h,
        'stock_left_ml': None if bottle is None else ML * bottle.left,
        'times_s': (start + outlook.times).tolist(),
        'zone_ml': dict(zip(names, (outlook.zone_tracer * ML).tolist(), strict=True)),
        'zone_area_cm2': dict(zip(names, (outlook.zone_area * 1e4).tolist(), strict=True)),
        'zone_reached': outlook.zone_reached.tolist(),
    }
