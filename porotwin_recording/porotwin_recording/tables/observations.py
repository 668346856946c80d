"""Readings beside the maps: `observations.csv` of an experiment folder."""

from collections.abc import Iterable
from pathlib import Path

from porotwin_core.basis.csv_table import number_text, parse_number, read_table, write_table
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.likely_name import as_known
from porotwin_core.basis.text_with_unit import was_percent
from porotwin_core.basis.units import LONGEST_EXPERIMENT_S
from porotwin_core.model.gauge_reading import GaugeKind, GaugeReading, Port
from porotwin_core.rig import SIDES, Rig

HEADER = ('time_s', 'kind', 'place', 'against', 'value', 'deviation')


def read_readings(path: Path, rig: Rig) -> tuple[GaugeReading, ...]:
    """Return the readings in the file `path`, converted to SI units, in the order of their times.

    Raises:
        InputError: one line that names file, line, value and remedy.
    """
    found = [
        _reading(words, where, rig) for where, words in read_table(path, HEADER, 'the readings')
    ]
    return tuple(sorted(found, key=lambda one: one.time))


def _reading(words: list[str], where: str, rig: Rig) -> GaugeReading:
    time = parse_number(words[0], f'{where}: time_s')
    if time < 0:
        raise InputError(f'{where}: time_s {time:g} is negative; times count from the start')
    if time > LONGEST_EXPERIMENT_S:
        raise InputError(f'{where}: time_s {time:g} is more than a year; write seconds')
    try:
        kind = GaugeKind(words[1])
    except ValueError:
        known_kinds = ', '.join(GaugeKind)
        raise InputError(f"{where}: unknown kind '{words[1]}'; write {known_kinds}") from None
    value, deviation = (
        parse_number(word, f'{where}: {name}')
        for name, word in zip(HEADER[4:], words[4:], strict=True)
    )
    if not deviation > 0:
        raise InputError(
            f'{where}: deviation {deviation:g}; write how far the reading may be off, above 0'
        )
    if kind is GaugeKind.CONCENTRATION and not 0.0 <= value <= 1.0:
        raise InputError(
            f'{where}: concentration {value:g}; must lie between 0 (water) and 1 (stock)'
            f'{was_percent(value)}'
        )
    if kind is GaugeKind.PRESSURE:
        port = _port(words[2], f'{where}: place', rig)
        against = _port(words[3], f'{where}: against', rig) if words[3] else None
        at_side = (body.side for body in rig.water_bodies.values() if body.head_m is not None)
        if against is None and not any(at_side):
            raise InputError(
                f"{where}: against is empty, but no water stands at a side of '{rig.name}'; write "
                'the x and z of a second port'
            )
        return GaugeReading(time, kind, value, deviation, port=port, against=against)
    known = (*rig.wells, *SIDES, *rig.water)
    place = as_known(words[2], known)
    if place not in known:
        raise InputError(f"{where}: unknown place '{words[2]}'; the rig has {', '.join(known)}")
    if words[3]:
        raise InputError(f"{where}: against '{words[3]}' belongs to a pressure; leave it empty")
    unit = kind.per_si
    return GaugeReading(time, kind, value / unit, deviation / unit, place)


def _port(text: str, where: str, rig: Rig) -> Port:
    parts = text.split()
    if len(parts) != 2:
        raise InputError(f"{where} '{text}'; a port is its x and z in metres, such as 0.3 0.1")
    x, z = (parse_number(part, where) for part in parts)
    if not (0.0 <= x <= rig.width_m and 0.0 <= z <= rig.height_m):
        raise InputError(
            f'{where} {text} lies outside the sand, 0 to {rig.width_m:g} m and 0 to '
            f'{rig.height_m:g} m; write metres from its lower left corner'
        )
    return x, z


def write_readings(path: Path, readings: Iterable[GaugeReading]) -> None:
    """Write `readings` as a table that `read_readings` reads back."""
    write_table(path, HEADER, map(_row, readings))


def _row(one: GaugeReading) -> tuple[str, ...]:
    unit = one.kind.per_si
    place = one.place if one.port is None else _port_text(one.port)
    against = '' if one.against is None else _port_text(one.against)
    numbers = (number_text(number * unit) for number in (one.value, one.deviation))
    return number_text(one.time), str(one.kind), place, against, *numbers


def _port_text(port: Port) -> str:
    return ' '.join(map(number_text, port))
