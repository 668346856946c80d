"""The limits of the pumps in rig.yaml, checked by the virtual rig itself.

The twin checks these limits too. The virtual rig checks them independently.
"""

import math

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.floors import WRITTEN_ROUND_OFF
from porotwin_core.basis.units import to_ml_h
from porotwin_core.rates.rate_periods import ROUND_OFF_ML_H
from porotwin_core.rates.wells import WellRate, WellRates, net_rate, net_rate_words
from porotwin_core.rig import Control, Rig


def refuse_broken_limits(rig: Rig, rates: WellRates) -> None:
    """Check that rates keep the limits of `rig`.

    Raises:
        InputError: a limit is broken; one line with the well, the rate and the limit.
    """
    for name in rates:
        if name not in rig.wells:
            raise InputError(f"well '{name}' is not in the rig; known: {', '.join(rig.wells)}")
    control = rig.control
    if control is None:
        return
    commanded = {name: to_ml_h(rates.get(name, WellRate()).rate) for name in rig.wells}
    for name in control.wells:
        if not -ROUND_OFF_ML_H <= commanded[name] <= control.max_rate_ml_h + ROUND_OFF_ML_H:
            raise InputError(
                f"well '{name}': rate {commanded[name]:.1f} ml/h lies outside 0 to "
                f'{control.max_rate_ml_h:.1f} ml/h; see rig.yaml'
            )
    total = math.fsum(commanded[name] for name in control.wells)
    if total > control.max_total_rate_ml_h + ROUND_OFF_ML_H:
        raise InputError(
            f'control wells inject {total:.1f} ml/h together, more than '
            f'{control.max_total_rate_ml_h:.1f} ml/h; see rig.yaml'
        )
    for name, fixed in control.fixed.items():
        rests = bool(fixed.pauses_min) and abs(commanded[name]) <= ROUND_OFF_ML_H
        if not rests and abs(commanded[name] - fixed.rate_ml_h) > ROUND_OFF_ML_H:
            raise InputError(
                f"well '{name}': rate {commanded[name]:.1f} ml/h; it must stay at "
                f'{fixed.rate_ml_h:.1f} ml/h'
            )
    if control.producer is not None and control.max_producer_rate_ml_h is not None:
        taken = -commanded[control.producer]
        if taken > control.max_producer_rate_ml_h + ROUND_OFF_ML_H:
            raise InputError(
                f"well '{control.producer}': takes out {taken:.1f} ml/h, more than "
                f'{control.max_producer_rate_ml_h:.1f} ml/h; see rig.yaml'
            )
    _refuse_wrong_roles(control, rates)
    net = net_rate(rates)
    if control.producer is not None and abs(to_ml_h(net)) > ROUND_OFF_ML_H:
        raise InputError(f'{net_rate_words(net)}; with a producer they must balance')


def _refuse_wrong_roles(control: Control, rates: WellRates) -> None:
    """Refuse wells that pump without a role, and wells that inject the wrong fluid."""
    roles = {*control.wells, *control.fixed, control.producer}
    for name, well in rates.items():
        if abs(to_ml_h(well.rate)) <= ROUND_OFF_ML_H:
            continue
        if name not in roles:
            raise InputError(
                f"well '{name}': rate {to_ml_h(well.rate):.1f} ml/h, but no role in control; "
                'see rig.yaml'
            )
        fluid = control.fixed[name].concentration if name in control.fixed else 0.0
        if well.rate > 0.0 and abs(well.concentration - fluid) > WRITTEN_ROUND_OFF:
            raise InputError(
                f"well '{name}' injects concentration {well.concentration:g}, must be {fluid:g}"
            )
