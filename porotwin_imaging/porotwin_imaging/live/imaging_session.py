"""The state of imaging beside a rig: the baseline, the sequence, and waiting photographs.

`ImagingNode` is a thin shell around an `ImagingSession`. Everything that changes from photograph to
photograph is an attribute here; the imaging itself (`photo_to_map.py`) has no state.
"""

from dataclasses import dataclass

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import Grid
from porotwin_core.model.tracer_share import FILLED_SHARE, tracer_share
from porotwin_core.rig import Rig
from porotwin_imaging.baseline.baseline import Baseline, make_baseline
from porotwin_imaging.geometry.corners_and_lens import Geometry
from porotwin_imaging.live.frozen_camera import FrozenCamera
from porotwin_imaging.live.photo_sequence import Placement, SequenceState, accept, place
from porotwin_imaging.live.waiting_photos import WaitingPhotos
from porotwin_imaging.photo_to_map import ConcentrationMap, concentration_map
from porotwin_imaging.photograph.sent_photos import MOST_BASELINES, digest_of
from porotwin_imaging.tracer.calibration import Calibration

WAITING_PHOTOS = 64
"""State photographs that are kept until the baseline arrives, or until they are read."""


@dataclass(frozen=True)
class ImagedState:
    """A photograph that has become a state of the asset.

    Attributes:
        time: exposure time [s].
        number: index of the state since the last new baseline, from 0.
        placement: place in the sequence of photographs.
        map: the concentration map.
    """

    time: float
    number: int
    placement: Placement
    map: ConcentrationMap


class ImagingSession:
    """Turns the stream of photographs of one rig into states.

    Args:
        rig: the rig with its camera.
        grid: the grid of the maps.
        calibration: conversion of signal to concentration, or None for the default scale.
        longest_gap_s: longest time without photographs [s]; None: from the usual interval.
        replayed: whether the photographs are those of a recording, which may be played again.

    Raises:
        InputError: the rig has no camera, or an impossible one, or the calibration is of another
            rig.
    """

    def __init__(
        self,
        rig: Rig,
        grid: Grid,
        *,
        calibration: Calibration | None = None,
        longest_gap_s: float | None = None,
        replayed: bool = False,
    ) -> None:
        Geometry.of(rig)  # a wrong camera is reported before the first photograph
        if calibration is not None:
            calibration.check_rig(rig)
        self.rig = rig
        self.grid = grid
        self.calibration = calibration
        self.baseline: Baseline | None = None
        self.baseline_photos: list[bytes] = []
        self._longest_gap_s = longest_gap_s
        self._replayed = replayed
        self._sequence = SequenceState()
        self._frozen = FrozenCamera()
        self._states = 0
        self._baselines_taken: set[str] = set()
        self.waiting = WaitingPhotos(WAITING_PHOTOS)
        """The photographs that came before the baseline."""

    def add_baseline(self, data: bytes) -> list[tuple[float, bytes]]:
        """Take the photograph `data` (bytes of the file) as a baseline.

        Before the first state it is averaged with the earlier baselines; after that it starts a new
        experiment. A baseline that was taken before changes nothing: a restarted camera offers it
        again. Returns time [s] and bytes of the photographs that have waited for it.

        Raises:
            InputError: the photograph cannot be used or shows tracer; the session is unchanged.
        """
        digest = digest_of(data)
        if digest in self._baselines_taken:
            return []
        new_experiment = self._states > 0
        if new_experiment:
            self._refuse_tracer(data)
        photos = [data] if new_experiment else [*self.baseline_photos, data][-MOST_BASELINES:]
        self.baseline = make_baseline(self.rig, self.grid, photos, calibration=self.calibration)
        self.baseline_photos = photos
        self._baselines_taken.add(digest)
        if new_experiment:
            self._states = 0
            self._sequence = SequenceState()
            self._frozen = FrozenCamera()
        return self.waiting.release()

    def leave_out_baseline(self, data: bytes) -> None:
        """Never take the photograph `data` (bytes of the file) as a baseline."""
        self._baselines_taken.add(digest_of(data))

    def add_photo(self, time: float, data: bytes) -> ImagedState:
        """Return the state that the photograph `data`, exposed at `time` [s], shows.

        Raises:
            InputError: there is no baseline, the photograph is a duplicate or late, the camera is
                frozen, or it cannot be used.
        """
        if self.baseline is None:
            raise InputError('no baseline yet: give a photograph taken before the injection')
        digest = digest_of(data)
        placement, self._sequence = place(
            time,
            digest,
            self._sequence,
            longest_gap_s=self._longest_gap_s,
            replayed=self._replayed,
        )
        if placement.action == 'ignore':
            raise InputError(placement.reason)
        if self._replayed and placement.action == 'start':
            self._frozen.last.clear()  # a recording that is played again may show its last picture
        found = concentration_map(data, self.baseline, self._frozen.check)
        self._sequence = accept(time, digest, placement, self._sequence)
        state = ImagedState(time, self._states, placement, found)
        self._states += 1
        return state

    def _refuse_tracer(self, data: bytes) -> None:
        """Raise InputError if a new baseline shows tracer against the baseline in use.

        A camera that is restarted during an experiment declares its first photograph a baseline.
        """
        assert self.baseline is not None
        try:
            values = concentration_map(data, self.baseline).values
        except InputError:  # another view or sand cannot be compared with the old baseline
            return
        share = tracer_share(values)
        if share > FILLED_SHARE:
            raise InputError(
                f'as a new baseline it shows tracer on {100 * share:.0f} % of the rig; take one '
                'without tracer, or start the twin again. The baseline in use stays'
            )
