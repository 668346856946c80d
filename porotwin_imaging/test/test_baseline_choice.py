"""The first usable photograph becomes the baseline."""

import cv2
import numpy as np

from porotwin_imaging.sources.baseline_choice import BaselineChoice
from porotwin_imaging.sources.camera_source import CameraPhoto, Polled, Role


def photo(name: str, level: int = 90, role: Role | None = None) -> CameraPhoto:
    """Return an even grey photograph."""
    data = cv2.imencode('.jpg', np.full((64, 96, 3), level, np.uint8))[1].tobytes()
    return CameraPhoto(data, 0.0, name, role)


def roles(polled: Polled) -> list[tuple[str, Role | None]]:
    return [(one.name, one.role) for one in polled.photos]


def test_black_and_over_exposed_photographs_cannot_be_the_baseline() -> None:
    choice = BaselineChoice()
    first = choice.with_roles(Polled([photo('1.jpg', 0), photo('2.jpg', 255)], []))
    assert first.photos == []
    told = [(problem.key, problem.code) for problem in first.problems]
    assert told == [('1.jpg', 'no_baseline'), ('2.jpg', 'no_baseline')]
    second = choice.with_roles(Polled([photo('3.jpg'), photo('4.jpg', 0)], []))
    assert roles(second) == [('3.jpg', 'baseline'), ('4.jpg', 'state')]
    assert roles(choice.with_roles(Polled([photo('5.jpg')], []))) == [('5.jpg', 'state')]


def test_roles_of_the_source_are_kept_and_end_the_choice() -> None:
    choice = BaselineChoice()
    given = Polled([photo('1.jpg', role='state'), photo('2.jpg', role='baseline')], [])
    assert roles(choice.with_roles(given)) == [('1.jpg', 'state'), ('2.jpg', 'baseline')]
    assert roles(choice.with_roles(Polled([photo('3.jpg')], []))) == [('3.jpg', 'state')]
