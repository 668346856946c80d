"""The data of one experiment, as a folder or a bag holds them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from porotwin_checks.known import Known
from porotwin_core.model.gauge_reading import GaugeReading
from porotwin_core.rates.fixed_pauses import FixedPauses
from porotwin_core.rates.rate_periods import balanced
from porotwin_core.rates.water_levels import WaterLevels
from porotwin_core.rates.wells import Schedule, later_commands
from porotwin_core.rig import Rig
from porotwin_recording.tables.concentration import ConcentrationMaps
from porotwin_recording.tables.photos import Photo


@dataclass(frozen=True)
class RecordedData:
    """Rig, pump rates, tracer maps and photographs of one experiment.

    Times count in seconds from the start of the experiment.

    Attributes:
        rig: nominal description of the rig.
        commanded: rates that the pumps should deliver; None where there are none.
        measured: rates that the pumps delivered; None where nobody measured them.
        maps: tracer maps, read from disk on demand; None where there are none.
        photos: photographs, ordered by time.
        remarks: faults of the recording that did not prevent reading it, one line each.
        replaced_rig: the description that the recording holds, if `rig` was given instead.
        readings: readings of the outflow and of pressures, ordered by time.
        by_hand: whether people told all `measured` rates, and no meter did.
    """

    rig: Rig
    commanded: Schedule | None = None
    measured: Schedule | None = None
    maps: ConcentrationMaps | None = None
    photos: tuple[Photo, ...] = ()
    remarks: tuple[str, ...] = ()
    replaced_rig: Rig | None = None
    readings: tuple[GaugeReading, ...] = ()
    by_hand: bool = False

    @property
    def announced(self) -> Schedule | None:
        """The commanded rates with the announced pauses of the rig; None where there are none."""
        if self.commanded is None:
            return None
        return FixedPauses.of(self.rig).in_schedule(self.commanded)

    @property
    def end(self) -> float:
        """The last known time [s], see `Known`."""
        return self._known_without_rates.end

    @property
    def is_virtual(self) -> bool:
        """Whether the virtual rig made the maps, or took the photographs."""
        mapped = self.maps is not None and self.maps.origin.is_virtual
        return mapped or (bool(self.photos) and self.photos[0].is_virtual)

    @property
    def known_rates(self) -> Schedule | None:
        """Measured rates where they exist, announced rates elsewhere, well by well.

        The announced rates of a well count before its first measured row, from the last measured
        row of all wells on, and always if the well is not measured. In a closed rig the producer
        balances all others, as in the hub, because measured rates never add up to zero exactly.
        None if there are neither.
        """
        commanded = self.announced
        if self.measured is None or not self.measured.rows:
            return commanded
        rows = self.measured.rows
        begin = {row.well: row.time for row in reversed(rows)}
        later = later_commands(commanded, self.measured)
        earlier = [
            row
            for row in (() if commanded is None else commanded.rows)
            if row.time < begin.get(row.well, rows[-1].time)
        ]
        known = self._balanced(Schedule((*rows, *earlier, *later)))
        return replace(known, levels=WaterLevels.of(self.rig))

    def _balanced(self, schedule: Schedule) -> Schedule:
        """Return `schedule`, balanced by the producer of the control section in a closed rig."""
        producer = self.rig.control.producer if self.rig.control else None
        if producer is None or not self.rig.closed:
            return schedule
        times = dict.fromkeys(row.time for row in schedule.rows)
        return Schedule.from_rates((time, balanced(schedule.at(time), producer)) for time in times)

    def known(self, names: Sequence[str] = ()) -> Known:
        """Return what the checks may look at; `names` for the maps, such as their photographs.

        Maps that no calibration made hide no tracer, but their concentrations mean nothing.
        """
        maps = self.maps
        return replace(
            self._known_without_rates,
            pumped=self.known_rates,
            maps=maps,
            scaled_maps=None if maps is None or maps.origin.calibrated is False else maps,
            names=names,
            readings=self.readings,
        )

    @property
    def _known_without_rates(self) -> Known:
        return Known(
            rig=self.rig,
            commanded=self.commanded,
            measured=self.measured,
            times=() if self.maps is None else self.maps.times,
            photos=self.photos,
        )
