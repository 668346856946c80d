"""./porotwin pumps: the lines to the pumps, without a device."""

import math
from pathlib import Path
from typing import Annotated

import typer

from porotwin_core.basis.errors import InputError


def command(
    rig: Annotated[Path, typer.Argument(help='rig.yaml, or a folder with one.')],
    pumps: Annotated[Path, typer.Argument(help='The pump file; see docs/pumps.md.')],
    rate: Annotated[
        list[str] | None,
        typer.Option(
            help='WELL=RATE [ml/h] of the setpoint; may be given several times. The other wells '
            'have their safe rates, and the producer balances all.'
        ),
    ] = None,
) -> None:
    """Show every command that the pumps would get: a dry run without a device.

    A setpoint follows the start, and the end follows the setpoint. Each line shows the serial line,
    the question and the answer that a faultless pump gives.

    Example: ./porotwin pumps rig.yaml pumps.yaml --rate control1=200
    """
    from porotwin_core.basis.text_with_unit import told_rate_ml_h
    from porotwin_core.basis.units import from_ml_h
    from porotwin_core.rates.safe_rates import safe_rates
    from porotwin_core.rates.wells import WellRate, net_rate
    from porotwin_core.rig import load_rig
    from porotwin_pumps.dry_run import dry_run
    from porotwin_pumps.pump_file import load_pumps

    described = load_rig(rig)
    entries = load_pumps(pumps, described)
    rates = safe_rates(described)
    for words in rate or []:
        well, _, text = words.partition('=')
        number = told_rate_ml_h(text)
        if not math.isfinite(number):
            raise InputError(f"--rate {words}: '{text}' is no rate; write WELL=RATE")
        if well not in rates:
            raise InputError(f"--rate {words}: well '{well}' is not in rig.yaml")
        rates[well] = WellRate(from_ml_h(number), rates[well].concentration)
    if described.control is not None and described.control.producer is not None:
        producer = described.control.producer
        rest = {well: one for well, one in rates.items() if well != producer}
        rates[producer] = WellRate(-net_rate(rest))
    dry_run(described, entries, rates, print)
