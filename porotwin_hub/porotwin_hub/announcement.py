"""Setpoints in words: text for a terminal, sentences for a voice."""

from dataclasses import dataclass

from porotwin_core.units import to_ml_h
from porotwin_core.wells import WellRates
from porotwin_hub.setpoint_limits import SAME_SETTING_ML_H


@dataclass(frozen=True)
class Announcement:
    """A setpoint in words: `text` to read, `speech` to hear, `changed` wells to set."""

    text: str
    speech: str
    changed: tuple[str, ...]


def _spoken_name(well: str) -> str:
    """Return 'control 2' for 'control2', so that a voice reads the number by itself."""
    head = well.rstrip('0123456789')
    return f'{head} {well[len(head) :]}'.replace('_', ' ').strip()


def announce(sequence: int, rates: WellRates, before: WellRates) -> Announcement:
    """Return the words for setpoint `sequence`, with every rate in ml/h.

    Args:
        sequence: the number of the setpoint.
        rates: the rates to set [m^3/s].
        before: the rates until now [m^3/s]; a well that is missing there counts as changed.
    """
    return _words(f'setpoint {sequence}', '', rates, before)


def announce_expiry(sequence: int, safe: WellRates, before: WellRates) -> Announcement:
    """Return the words for the expired setpoint `sequence`: the `safe` rates [m^3/s] hold now."""
    title = f'setpoint {sequence} has expired and none followed; the safe rates hold'
    return _words(title, f'Setpoint {sequence} has expired. ', safe, before)


def _words(title: str, opening: str, rates: WellRates, before: WellRates) -> Announcement:
    changed = tuple(
        well
        for well, rate in rates.items()
        if well not in before or abs(to_ml_h(rate.rate - before[well].rate)) > SAME_SETTING_ML_H
    )
    lines = [title]
    for well, rate in rates.items():
        value = to_ml_h(rate.rate)
        line = f'  {well:12} {value:8.1f} ml/h'
        if well in changed:
            known = well in before
            line += f'   <-- was {to_ml_h(before[well].rate):.1f}' if known else '   <-- set'
        lines.append(line)
    spoken = [f'{_spoken_name(well)}: {to_ml_h(rates[well].rate):.0f}' for well in changed]
    speech = opening + (f'Set {", ".join(spoken)}.' if spoken else 'No change.')
    return Announcement('\n'.join(lines), speech.replace(': -', ': minus '), changed)
