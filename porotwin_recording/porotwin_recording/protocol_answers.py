"""A person answers the open questions of protocols; times follow these answers."""

from dataclasses import dataclass
from datetime import datetime

from porotwin_recording.foreign_table import Decimal, ForeignTable
from porotwin_recording.foreign_time import DateOrder, moments

IMAGING_PROTOCOL = 'imaging_protocol.csv'
INJECTION_PROTOCOL = 'injection_protocol.csv'
MEASURED_PROTOCOL = 'measured_protocol.csv'


@dataclass(frozen=True)
class ProtocolAnswers:
    """Answers to open questions of protocols; empty or None: as the protocols show.

    Attributes:
        date_order: order of day and month.
        time_zone: zone of times without one, such as Europe/Oslo.
        decimal: decimal point or comma.
        rate_unit: unit of rates, such as ml/min.
        concentration: concentration of injected fluids where no column has it [-].
        camera_ahead_s: time by which the camera's clock is ahead of the pumps' [s].
        time_zero: date and time of second 0 of rates.csv, by the clock of the pumps.
    """

    date_order: DateOrder | None = None
    time_zone: str = ''
    decimal: Decimal | None = None
    rate_unit: str = ''
    concentration: float | None = None
    camera_ahead_s: float = 0.0
    time_zero: str = ''


def protocol_moments(
    table: ForeignTable, title: str, answers: ProtocolAnswers, told: list[str]
) -> list[datetime]:
    """Return the times in the column `title`; tell the assumptions about them."""
    where = f'{table.path}: {table.spelt(title)}'
    found, remarks = moments(
        table.columns[title], where, order=answers.date_order, zone=answers.time_zone
    )
    told += [line for line in remarks if line not in told]
    return found
