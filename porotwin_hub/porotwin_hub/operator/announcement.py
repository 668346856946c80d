"""Setpoints in words: text for a terminal, sentences for a voice."""

from dataclasses import dataclass
from datetime import datetime, timedelta

from porotwin_core.basis.plain_text import plain
from porotwin_core.basis.units import setting_ml_h
from porotwin_core.clock.stamps import SINCE_1970
from porotwin_core.rates.rate_periods import SAME_RATE, different_wells
from porotwin_core.rates.wells import WellRate, WellRates
from porotwin_core.ros.foreign_words import in_short

NO_SETPOINT = 'no setpoint: '
"""Begin of the hub's remark that tells why no setpoint follows from a photograph."""

BY_THE_PUMPS = 'by the pumps it would be'
"""Words of the hub's remark that a photograph holds another volume than the pumps tell."""


@dataclass(frozen=True)
class Announcement:
    """A setpoint in words: `text` to read, `speech` to hear, `changed` wells to set."""

    text: str
    speech: str
    changed: tuple[str, ...]


def clock_time(seconds: float) -> str:
    """Return a time in words: the time of the day, or h:mm:ss since the start of an experiment."""
    if seconds < SINCE_1970:
        return str(timedelta(seconds=round(seconds)))
    return datetime.fromtimestamp(seconds).astimezone().strftime('%H:%M:%S')


def announce(
    sequence: int,
    rates: WellRates,
    before: WellRates,
    *,
    note: str = '',
    reason: str = '',
    same: float = SAME_RATE,
) -> Announcement:
    """Return the words for setpoint `sequence`, with every rate in ml/h.

    Args:
        sequence: the number of the setpoint.
        rates: the rates to set [m^3/s].
        before: the rates at the pumps [m^3/s]; a well that is missing there counts as changed.
        note: follows the number, such as the time of the photograph.
        reason: why these rates, in one line; may be empty.
        same: rates that differ by at most this are the same [m^3/s].
    """
    others = different_wells(rates, before, same=same)
    changed = tuple(well for well in rates if well not in before or well in others)
    speech = ' '.join(_order(well, rates[well]) for well in changed) or 'No change.'
    why = f'\n  why: {in_short(reason)}' if reason else ''
    title = f'setpoint {sequence}{note}{why}'
    return Announcement(_table(title, rates, before, changed), speech, changed)


def announce_expiry(
    sequence: int, safe: WellRates, before: WellRates, *, note: str = '', pause: bool = False
) -> Announcement:
    """Return the words for the expired setpoint `sequence`: the `safe` rates [m^3/s] hold now.

    They name every well: whoever missed the last setpoints must not miss a pump. `pause` tells that
    they were announced before, and an announced pause has changed them.
    """
    title = f'setpoint {sequence} has expired and none followed{note}'
    opening = f'Setpoint {sequence} has expired.'
    if pause:
        title += '; an announced pause begins or ends'
        opening = 'An announced pause begins or ends.'
    title += '; set the safe rates now'
    orders = ' '.join(_order(well, rate) for well, rate in safe.items())
    speech = f'{opening} Set the safe rates now. {orders}'.strip()
    return Announcement(_table(title, safe, before, tuple(safe)), speech, tuple(safe))


def confirmation_in_words(sequence: int, otherwise: WellRates, who: str) -> str:
    """Return the line about rates that a person has confirmed.

    Args:
        sequence: the number of the setpoint.
        otherwise: the rates that were not set as ordered [m^3/s].
        who: full name of the node that asked.
    """
    differs = ', '.join(
        f'{plain(well)} at {setting_ml_h(rate.rate)} ml/h' for well, rate in otherwise.items()
    )
    return f'confirmed by {in_short(who)}: setpoint {sequence} is set' + (
        f', but {differs}' * bool(differs)
    )


def _table(title: str, rates: WellRates, before: WellRates, changed: tuple[str, ...]) -> str:
    lines = [title]
    for well, rate in rates.items():
        line = f'  {plain(well):12} {setting_ml_h(rate.rate):>8} ml/h'
        if well in changed:
            last = before.get(well)
            if last is None or abs(rate.rate - last.rate) <= SAME_RATE:
                line += '   <-- set'
            else:
                line += f'   <-- was {setting_ml_h(last.rate)}'
        lines.append(line)
    return '\n'.join(lines)


def _order(well: str, rate: WellRate) -> str:
    """Return one short sentence that a voice reads well, such as 'Set control 2 to minus 740.'"""
    head = well.rstrip('0123456789')
    name = plain(f'{head} {well[len(head) :]}').replace('_', ' ').strip()
    value = float(setting_ml_h(rate.rate))
    if value == 0.0:
        return f'Switch {name} off.'
    sign = 'minus ' if value < 0.0 else ''
    return f'Set {name} to {sign}{abs(value):g}.'
