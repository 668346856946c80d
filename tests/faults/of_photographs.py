"""Photographs. Files that a camera, a cable or a person spoils."""

import time

import cv2

from faults.fault import Status, fault
from faults.stage import Stage, decoded, encoded
from porotwin_rig.faults import FAULTS as SPOILED

NEXT_GOOD = 'the next good photograph'
LEFT_OUT = 'Leaves it out. No state and no setpoint follow.'


def put_spoiled(stage: Stage, name: str) -> None:
    """Put a photograph with a fault of the mock camera into the folder."""
    stage.put(SPOILED[name](stage.picture()), good=False)


@fault(
    'A file ends in the middle.',
    Status('camera', 'ERROR', 'truncated or broken'),
    does=LEFT_OUT,
    mends=NEXT_GOOD,
)
def truncated(stage: Stage) -> None:
    put_spoiled(stage, 'truncated')


@fault(
    'A file is empty.',
    Status('camera', 'ERROR', 'truncated or broken'),
    does=LEFT_OUT,
    mends=NEXT_GOOD,
)
def empty(stage: Stage) -> None:
    put_spoiled(stage, 'empty')


@fault(
    'A file with the name of a photograph holds other bytes.',
    Status('camera', 'ERROR', 'truncated or broken'),
    does=LEFT_OUT,
    mends=NEXT_GOOD,
)
def no_photograph(stage: Stage) -> None:
    put_spoiled(stage, 'garbage')


@fault(
    'A photograph is black: the lens cap is on, or the light is off.',
    Status('imaging', 'ERROR', 'left out'),
    does=LEFT_OUT,
    mends=NEXT_GOOD,
)
def black(stage: Stage) -> None:
    put_spoiled(stage, 'black')


@fault(
    'A photograph is white: the exposure is far too long.',
    Status('imaging', 'ERROR', 'left out'),
    does=LEFT_OUT,
    mends=NEXT_GOOD,
)
def white(stage: Stage) -> None:
    put_spoiled(stage, 'overexposed')


@fault(
    'A photograph has half the size.',
    Status('imaging', 'ERROR', 'keep the camera as it is or take a new baseline'),
    does=LEFT_OUT,
    mends=NEXT_GOOD,
)
def half_size(stage: Stage) -> None:
    put_spoiled(stage, 'half_size')


@fault(
    'A photograph is upside down.',
    Status('imaging', 'ERROR', 'left out'),
    does=LEFT_OUT,
    mends=NEXT_GOOD,
)
def upside_down(stage: Stage) -> None:
    put_spoiled(stage, 'upside_down')


@fault(
    'Hands cover a part of the sand.',
    Status('imaging', 'WARN', 'of the sand is covered or damaged'),
    does='Leaves out the covered cells. The forecast fills them, and control goes on.',
    mends='the next photograph without hands',
)
def hands(stage: Stage) -> None:
    pixels = decoded(stage.picture())
    cv2.circle(pixels, (450, 300), 60, (120, 150, 200), -1)
    stage.put(encoded(pixels), good=True)


@fault(
    'The camera sends the same photograph again under another name.',
    Status('imaging', 'ERROR', 'is a duplicate'),
    does='Leaves out the second one.',
    mends=NEXT_GOOD,
)
def repeated(stage: Stage) -> None:
    picture = stage.picture()
    stage.put(picture, good=True)
    stage.put(picture, good=False, taken=time.time() + 0.5)


@fault(
    'A photograph arrives after a later one.',
    Status('imaging', 'ERROR', 'is out of order'),
    does=LEFT_OUT,
    mends=NEXT_GOOD,
)
def out_of_order(stage: Stage) -> None:
    late = stage.picture()
    stage.wait_for_control()
    newest = stage.newest_good
    stage.put(late, good=False, taken=newest - 0.5 * (newest - stage.last_but_one_good))


@fault(
    'The folder is away for a while, as a network share may be.',
    does='Waits. No setpoint follows without a photograph.',
    mends='the folder is back',
)
def folder_away(stage: Stage) -> None:
    away = stage.photos.with_name('away')
    stage.photos.rename(away)
    stage.put(stage.picture(), good=True, folder=away)
    away.rename(stage.photos)
