"""The data of one experiment, as a folder or a bag holds them."""

from dataclasses import dataclass

from porotwin_core.rates.wells import Schedule
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
    """

    rig: Rig
    commanded: Schedule | None = None
    measured: Schedule | None = None
    maps: ConcentrationMaps | None = None
    photos: tuple[Photo, ...] = ()
    remarks: tuple[str, ...] = ()
    replaced_rig: Rig | None = None
