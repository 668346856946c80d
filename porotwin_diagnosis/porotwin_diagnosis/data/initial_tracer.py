"""Tracer that is in the rig when a recording begins: the model starts with it."""

from porotwin_checks.start import Start, start_of
from porotwin_core.geometry.grid import FloatArray
from porotwin_diagnosis.data.observed_maps import filled_map
from porotwin_recording.experiment.recording import Recording


def start_and_tracer(recording: Recording) -> tuple[Start, FloatArray | None]:
    """Return the start of `recording`, and the first map (nz, nx) [-] if its tracer is used.

    Raises:
        InputError: the recording holds no maps, or no rates.
    """
    first, _ = recording.present_maps[0], recording.delivered
    start = start_of(recording.known())
    return start, filled_map(first, recording.grid) if start is Start.USED else None


def initial_tracer(recording: Recording) -> FloatArray | None:
    """Return the tracer (nz, nx) [-] of `start_and_tracer`."""
    return start_and_tracer(recording)[1]
