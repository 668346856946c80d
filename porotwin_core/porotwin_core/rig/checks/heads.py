"""Do the heads of the open sides drive water, and not too much of it?"""

from collections.abc import Iterator

from porotwin_core.basis.check import Check
from porotwin_core.basis.plausibility import extent_remark
from porotwin_core.basis.remark import Remark
from porotwin_core.rig.description import Rig

STEEP = 0.3
"""Gradient of the head [-] between opposite sides that no laboratory flow has."""

MOST_GRADIENT = 10.0
"""Difference of two heads over the distance of their sides above which it is refused: sand would be
washed out, and a prediction takes minutes."""


def remarks_about_heads(rig: Rig) -> Iterator[Remark]:
    """Yield remarks about heads that drive no water, too much of it, or meet in a corner."""
    given, raised = rig.boundaries.heads_m, rig.boundaries.raised_heads
    key = 'boundaries.heads_m'
    heads = [body.head_m for body in rig.water.values() if body.head_m is not None]
    heads += (given or {}).values()
    steady = given and not rig.levels
    if steady and len(heads) == 1:
        why = 'only differences between open sides count, so that one head does nothing'
        remedy = 'remove it, or give the head of a second open side'
        yield Remark(key, f'{heads[0]:g} m', why, remedy)
    elif steady and min(heads) == max(heads):
        why = 'water flows only between open sides with different heads'
        yield Remark(key, f'{heads[0]:g} m everywhere', why, 'correct or remove it')
    for one, other in rig.boundaries.corners_with_a_jump:
        apart = abs(raised[one] - raised[other])
        why = f'the {one} and the {other} side meet in a corner, where their heads jump'
        remedy = (
            'the rate between them grows with the number of cells: trust no flow near '
            'this corner, or close one of the two sides'
        )
        yield Remark(key, f'{apart:g} m apart', why, remedy)
    for one, other, size, axis in (
        ('left', 'right', rig.width_m, 'x_m'),
        ('bottom', 'top', rig.height_m, 'z_m'),
    ):
        if one not in raised or other not in raised:
            continue
        fall = raised[one] - raised[other]
        if (apart := abs(fall)) > STEEP * size:
            why = f'the water falls by {apart:g} m over the {size:g} m between the two sides'
            far = apart > MOST_GRADIENT * size
            yield Remark(key, f'{apart:g} m apart', why, 'are they in cm? write m', refused=far)
        ways = _ways_to_the_producer(rig, axis)
        if ways and all(fall * way < 0.0 for way in ways):
            why = 'water flows from the producer to the wells that inject tracer'
            yield Remark(key, '', why, 'were the two heads exchanged?')
    yield from _courses(rig)


def _ways_to_the_producer(rig: Rig, axis: str) -> list[float]:
    """Return the way along `axis` from each fixed well of tracer to the producer [m]."""
    if rig.control is None or rig.control.producer is None:
        return []
    end = getattr(rig.wells[rig.control.producer], axis)
    tracer = [name for name, well in rig.control.fixed.items() if well.concentration]
    return [end - getattr(rig.wells[name], axis) for name in tracer]


def _courses(rig: Rig) -> Iterator[Remark]:
    """Yield a remark about every course of a level that goes too far from its head, or too long."""
    size = max(rig.width_m, rig.height_m)
    end_min = rig.control.end_min if rig.control is not None else None
    for name, course in rig.levels.items():
        head = rig.water_bodies[name].head_m or 0.0
        level = max((level for _, level in course.points), key=lambda level: abs(level - head))
        if (apart := abs(level - head)) > STEEP * size:
            why = f'the level changes by {apart:g} m from its head of {head:g} m'
            remedy = 'is it in cm? write m, or the unit behind it, such as 48 cm'
            far = apart > MOST_GRADIENT * size
            yield Remark(f'levels.{name}', f'{level:g} m', why, remedy, refused=far)
        last_min = course.every_min or course.points[-1][0]
        if end_min and (odd := extent_remark(f'levels.{name}', last_min, end_min, 'minutes')):
            yield odd


CHECK = Check(find=remarks_about_heads)
