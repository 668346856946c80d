"""The choice of the baseline: the first usable photograph of a source that gives no roles."""

from dataclasses import replace

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.remark import Remark
from porotwin_imaging.photograph.photo_file import decode
from porotwin_imaging.sources.camera_source import CameraPhoto, Polled

_REDUCTION = 8
"""The coarsest decoding is enough to find black and over-exposed photographs."""


class BaselineChoice:
    """Gives every photograph a role; remembers whether any photograph has been sent.

    Args:
        any_sent: True if photographs were sent before a restart.
    """

    def __init__(self, *, any_sent: bool = False) -> None:
        self._any_sent = any_sent

    def with_roles(self, polled: Polled) -> Polled:
        """Return the photographs with their roles.

        The first photograph without a role becomes the baseline, unless photographs were sent
        before. Broken, black and over-exposed photographs become problems instead.
        """
        photos, problems = [], list(polled.problems)
        for photo in polled.photos:
            if photo.role is not None:
                photos.append(photo)
            elif self._any_sent or photos:
                photos.append(replace(photo, role='state'))
            elif (problem := _unusable(photo)) is not None:
                problems.append(problem)
            else:
                photos.append(replace(photo, role='baseline'))
        self._any_sent = self._any_sent or bool(photos)
        return polled._replace(photos=photos, problems=problems)


def _unusable(photo: CameraPhoto) -> Remark | None:
    """Return the reason why a photograph cannot be the baseline, None if it can."""
    try:
        decode(photo.data, _REDUCTION)
    except InputError as error:
        why = f'the photograph cannot be the baseline, the next one is tried: {error}'
        return Remark(photo.name, '', why, '', code='no_baseline')
    return None
