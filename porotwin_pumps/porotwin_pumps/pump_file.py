"""The pump file: the pump of every well, and its serial line."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Literal

import pydantic
from pydantic import ConfigDict, Field, FiniteFloat

from porotwin_core.basis.errors import InputError
from porotwin_core.rig import Rig
from porotwin_core.rig.yaml_reader import read_yaml_file
from porotwin_pumps.protocols.protocol_registry import PROTOCOLS
from porotwin_pumps.protocols.pump_protocol import Pump
from porotwin_pumps.serial_line import SerialLine


class PumpEntry(pydantic.BaseModel):
    """The pump of one well. Additional keys are options of its protocol, all numbers."""

    model_config = ConfigDict(frozen=True, extra='allow')

    protocol: str
    port: str
    address: Annotated[int, Field(ge=0)] = 0
    baud: Annotated[int, Field(gt=0)] | None = None
    parity: Literal['N', 'E', 'O'] | None = None
    max_rate_ml_h: Annotated[FiniteFloat, Field(gt=0)]

    @property
    def options(self) -> dict[str, float]:
        """The options of the protocol."""
        return dict(self.model_extra or {})


def load_pumps(path: Path, rig: Rig) -> dict[str, PumpEntry]:
    """Return the pumps in the file `path` by the wells of `rig`.

    Raises:
        InputError: the file or an entry is wrong, or a well has no pump; one line.
    """
    data = read_yaml_file(path, remedy='docs/pumps.md shows one')
    entries = data.get('pumps') if isinstance(data, dict) else None
    if not isinstance(entries, dict) or set(data) != {'pumps'}:
        raise InputError(f'{path}: expected one key, pumps, with an entry for every well')
    pumps = {str(well): _entry(f'{path}: pump of {well}', item) for well, item in entries.items()}
    _check_wells(path, pumps, rig)
    _check_lines(path, pumps)
    return pumps


def _entry(where: str, data: Any) -> PumpEntry:
    try:
        entry = PumpEntry.model_validate(data)
    except pydantic.ValidationError as error:
        first = error.errors()[0]
        key = '.'.join(str(part) for part in first['loc']) or 'the entry'
        raise InputError(f'{where}: {key}: {first["msg"]}') from None
    if entry.protocol not in PROTOCOLS:
        raise InputError(
            f"{where}: no protocol is named '{entry.protocol}'; known: {', '.join(PROTOCOLS)}"
        )
    wanted = PROTOCOLS[entry.protocol].options
    for name, value in entry.options.items():
        if name not in wanted:
            raise InputError(f"{where}: unknown key '{name}'; {entry.protocol} has {list(wanted)}")
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InputError(f'{where}: {name} = {value!r}: give a number')
    missing = sorted(set(wanted) - set(entry.options))
    if missing:
        raise InputError(f"{where}: '{missing[0]}' is missing: {wanted[missing[0]]}")
    return entry


def _check_wells(path: Path, pumps: dict[str, PumpEntry], rig: Rig) -> None:
    """Refuse unknown wells, wells without a pump, and pumps too small for rig.yaml."""
    if rig.control is None:
        raise InputError(f"rig '{rig.name}' has no control section, so no pump can be set")
    unknown = sorted(set(pumps) - set(rig.wells))
    if unknown:
        raise InputError(
            f"{path}: well '{unknown[0]}' is not in rig.yaml; known: {', '.join(rig.wells)}"
        )
    control = rig.control
    fixed = {name: abs(well.rate_ml_h) for name, well in control.fixed.items()}
    needed = {**dict.fromkeys(control.wells, control.max_rate_ml_h), **fixed}
    if control.producer is not None:
        needed[control.producer] = control.most_taken_ml_h
    for well, rate_ml_h in needed.items():
        if well not in pumps:
            raise InputError(f"{path}: well '{well}' has no pump; name one for every well in use")
        if pumps[well].max_rate_ml_h < rate_ml_h:
            raise InputError(
                f"{path}: the pump of '{well}' runs at up to {pumps[well].max_rate_ml_h:g} ml/h, "
                f'rig.yaml asks for {rate_ml_h:g}; lower the limits there, or use another pump'
            )


def _check_lines(path: Path, pumps: dict[str, PumpEntry]) -> None:
    """Refuse two pumps with one address, and two speeds on one line."""
    seen: dict[tuple[str, int], str] = {}
    speeds: dict[str, tuple[int, str]] = {}
    for well, entry in pumps.items():
        place = (entry.port, entry.address)
        if place in seen:
            raise InputError(
                f"{path}: the pumps of '{seen[place]}' and '{well}' are both at address "
                f'{entry.address} of {entry.port}; give each its own'
            )
        seen[place] = well
        if speeds.setdefault(entry.port, _speed(entry)) != _speed(entry):
            raise InputError(
                f'{path}: {entry.port} has two speeds; give all its pumps one baud and parity'
            )


def _speed(entry: PumpEntry) -> tuple[int, str]:
    protocol = PROTOCOLS[entry.protocol]
    frame = protocol.frame
    parity = entry.parity or frame[1]
    return entry.baud or protocol.baud, f'{frame[0]}{parity}{frame[2]}'


def serial_line(entry: PumpEntry) -> SerialLine:
    """Return the line of a pump; the first question opens it."""
    baud, frame = _speed(entry)
    return SerialLine(entry.port, baud, frame=frame)


def pump_openers(
    pumps: dict[str, PumpEntry], line_of: Callable[[PumpEntry], SerialLine] = serial_line
) -> dict[str, Callable[[], Pump]]:
    """Return, for every well, a function that opens its pump; pumps on one line share it."""
    lines: dict[str, SerialLine] = {}

    def opener(entry: PumpEntry) -> Callable[[], Pump]:
        line = lines.setdefault(entry.port, line_of(entry))
        protocol = PROTOCOLS[entry.protocol]
        return lambda: protocol.open(line, entry.address, **entry.options)

    return {well: opener(entry) for well, entry in pumps.items()}
