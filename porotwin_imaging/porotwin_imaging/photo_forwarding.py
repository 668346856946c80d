"""Forwarding the photographs of a camera source, whatever fails on the way."""

from collections.abc import Callable

from porotwin_imaging.sources.baseline_choice import BaselineChoice
from porotwin_imaging.sources.camera_source import CameraPhoto, CameraSource, PhotoProblem


class PhotoForwarder:
    """Sends each photograph of a source once.

    A restarted camera node would meet the same file and fail again. Therefore no error ends the
    forwarding; each becomes a problem.

    Args:
        source: gives the photographs.
        send: called with each photograph; its role is set.
        report: called with each problem.
    """

    def __init__(
        self,
        source: CameraSource,
        *,
        send: Callable[[CameraPhoto], None],
        report: Callable[[PhotoProblem], None],
    ) -> None:
        self._source = source
        self._roles = BaselineChoice()
        self._send = send
        self._report = report

    def forward(self) -> None:
        """Poll the source once, send the new photographs and report the problems."""
        try:
            polled = self._roles.with_roles(self._source.poll())
        except Exception as error:
            self._report(PhotoProblem('', f'looking for photographs failed: {error!r}'))
            return
        for problem in polled.problems:
            self._report(problem)
        for photo in polled.photos:
            try:
                self._send(photo)
            except Exception as error:
                reason = f"photograph '{photo.name}' cannot be sent: {error!r}"
                self._report(PhotoProblem(photo.name, reason))
