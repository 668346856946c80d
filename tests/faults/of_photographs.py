"""Photographs. Files that a camera, a cable or a person spoils."""

import os
from collections.abc import Iterator

import cv2
import numpy as np

from faults.fault import LogLine, Remark, Status, fault
from faults.stage import CYCLES, Stage, decoded, encoded
from porotwin_rig.faults import FAULTS as SPOILED

NEXT_GOOD = 'nothing'
LEFT_OUT = 'Leaves out the photograph.'


def put_spoiled(stage: Stage, name: str) -> None:
    """Put a photograph with a fault of the mock camera into the folder."""
    stage.put(SPOILED[name](stage.picture()), good=False)


@fault(
    'A photograph shows a plume that no pump has made: it is from another experiment.',
    Remark('ml of tracer, and by the pumps it would be'),
    does='Uses the photograph, because the pumps may be wrong. Warns with both volumes.',
    mends='check the photographs, the baseline and the pumps',
)
def other_plume(stage: Stage) -> None:
    stage.good_picture(radius_m=0.12)


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
    Status('camera', 'ERROR', 'is no JPEG, PNG or TIFF'),
    does=LEFT_OUT,
    mends=NEXT_GOOD,
)
def no_photograph(stage: Stage) -> None:
    put_spoiled(stage, 'garbage')


@fault(
    'A photograph is black: the lens cap is on, or the light is off.',
    Status('imaging', 'ERROR', 'left out'),
    does=LEFT_OUT,
    mends='take off the lens cap, switch on the light',
)
def black(stage: Stage) -> None:
    put_spoiled(stage, 'black')


@fault(
    'A photograph is white: the exposure is far too long.',
    Status('imaging', 'ERROR', 'left out'),
    does=LEFT_OUT,
    mends='shorten the exposure',
)
def white(stage: Stage) -> None:
    put_spoiled(stage, 'overexposed')


@fault(
    'A photograph has half the size.',
    Status('imaging', 'ERROR', 'keep the camera as it is or take a new baseline'),
    does=LEFT_OUT,
    mends='set the old size, or take a new baseline',
)
def half_size(stage: Stage) -> None:
    put_spoiled(stage, 'half_size')


@fault(
    'A photograph is upside down.',
    Status('imaging', 'ERROR', 'left out'),
    does=LEFT_OUT,
    mends='turn the camera back',
)
def upside_down(stage: Stage) -> None:
    put_spoiled(stage, 'upside_down')


@fault(
    'Hands cover a part of the sand.',
    Status('imaging', 'WARN', 'of the sand is covered or damaged'),
    does='Leaves out the covered cells. The forecast fills them. Control continues.',
    mends='remove the hands',
)
def hands(stage: Stage) -> None:
    pixels = decoded(stage.picture())
    cv2.circle(pixels, (450, 300), 60, (120, 150, 200), -1)
    stage.put(encoded(pixels), good=True)


@fault(
    'The camera sends the same photograph again and again under other names.',
    Status('camera', 'ERROR', 'is a duplicate of'),
    Status('camera', 'ERROR', 'the camera is frozen; restart it'),
    does='Leaves out all but the first.',
    mends='restart the camera',
)
def repeated(stage: Stage) -> None:
    stage.wait_for_control()
    same = stage.newest
    for _ in range(2):
        stage.put(same, good=False)


@fault(
    'The camera is frozen: it sends its last picture again and again, each with a new EXIF time.',
    Status('imaging', 'ERROR', 'the camera is frozen'),
    does='Leaves out the photographs, because their noise is not fresh. No state and no setpoint '
    'follow, and the asset goes to its safe rates in the end.',
    mends='restart the camera',
)
def frozen_camera(stage: Stage) -> None:
    stage.wait_for_control()
    for _ in range(CYCLES):
        stage.put(stage.frozen_picture(), good=False)


@fault(
    'A photograph arrives long after a later one.',
    Status('camera', 'ERROR', 'out of order'),
    does=LEFT_OUT,
    mends=NEXT_GOOD,
)
def out_of_order(stage: Stage) -> None:
    stage.put(encoded(decoded(stage.picture())), good=False, taken=stage.newest_good - 30.0)


@fault(
    'Files have the times 1970, 2001 and 2038, and no EXIF time.',
    Status('camera', 'ERROR', 'has no believable time'),
    does='Believes none of these times. At the pace of a camera the arrival counts, otherwise the '
    'photograph is left out.',
    mends="set the camera's clock",
)
def impossible_file_times(stage: Stage) -> None:
    for taken in (0.0, 1e9 - 86400.0, 2.0**31 - 86400.0):
        stage.put(encoded(decoded(stage.picture())), good=False, taken=taken)


@fault(
    "The camera's clock is an hour ahead.",
    LogLine('camera', 'is not believed'),
    does='Uses the time of the file, which another clock wrote. If that is not believable either, '
    'uses the time of arrival. Control goes on.',
    mends="set the camera's clock",
)
def camera_clock_ahead(stage: Stage) -> None:
    picture = stage.picture(ahead_s=3600.0)
    stage.put(picture, good=True)


@fault(
    'A file name is not UTF-8.',
    does='Reads the photograph. Messages show the name with escapes.',
    mends='nothing',
)
def name_not_utf8(stage: Stage) -> None:
    stage.good_photograph(name=b'gr\xfcn_\xff.jpg')


@fault(
    'A FIFO has the name of a photograph.',
    Status('camera', 'ERROR', 'is a FIFO, socket or device'),
    does='Leaves out the FIFO, and does not wait for it.',
    mends='nothing',
)
def fifo(stage: Stage) -> Iterator[None]:
    path = stage.photos / 'fifo.jpg'
    os.mkfifo(path)
    yield
    path.unlink()


@fault(
    'A camera uses one file name again and again.',
    does='Reads each new content as a new photograph.',
    mends='nothing',
)
def reused_name(stage: Stage) -> None:
    for _ in range(2):
        stage.wait_for_control(name=b'latest.jpg')


@fault(
    'The photographs are twice as bright: somebody changed the exposure.',
    Status('imaging', 'ERROR', 'over-exposed'),
    does=LEFT_OUT,
    mends='set the old exposure, or take a new baseline',
)
def twice_as_bright(stage: Stage) -> None:
    pixels = decoded(stage.picture()).astype(float)
    stage.put(encoded(np.clip(2.0 * pixels, 0, 255).astype(np.uint8)), good=False)


@fault(
    'The lamps give a quarter less light.',
    LogLine('imaging', 'times the light of the baseline: corrected by the colour chart'),
    does='Corrects the light by the chart, or without one by places that never change.',
    mends='nothing at once; set the lamps as for the baseline',
)
def dimmer_lamps(stage: Stage) -> None:
    pixels = decoded(stage.picture()).astype(float)
    stage.put(encoded((0.9 * pixels).astype(np.uint8)), good=True)


@fault(
    'All photographs so far are copied into the folder again under other names.',
    Status('camera', 'ERROR', 'is a duplicate of'),
    does='Leaves out the copies.',
    mends=NEXT_GOOD,
)
def sent_again(stage: Stage) -> None:
    for number, path in enumerate(sorted(stage.photos.glob('IMG_*.jpg'))[-5:]):
        stage.put(path.read_bytes(), good=False, name=f'copy_{number}.jpg')


@fault(
    'The folder is away for a while, as a network share may be.',
    Status('camera', 'ERROR', 'does not answer'),
    does='Waits. No setpoint follows without a photograph.',
    mends='connect the folder again',
)
def folder_away(stage: Stage) -> Iterator[None]:
    away = stage.photos.with_name('away')
    stage.photos.rename(away)
    yield
    away.rename(stage.photos)
