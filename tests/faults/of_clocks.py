"""Clocks. The clock of this machine is set while the twin runs."""

from collections.abc import Iterator

from faults.fault import Status, SupervisorLine, fault
from faults.stage import Stage, kill

TWO_HOURS_S = 7200

KEEPS = (
    'Tells by how much. Ages and waits go on by a clock that nobody sets, also in nodes that start '
    'again. Control continues.'
)
RESTART = 'nothing at once; start the twin again after the experiment'


def told(way: str) -> Status:
    """Return the sign of a clock that was set."""
    return Status('supervisor', 'WARN', f'was set {way} by 2:00:00')


def set_clock(stage: Stage, ahead_s: int) -> Iterator[None]:
    """Set the clock, take photographs until a setpoint follows, and set the clock right."""
    stage.clock.ahead_s = ahead_s
    stage.wait_for_control()
    yield
    stage.clock.ahead_s = 0


@fault("The computer's clock is set two hours ahead.", told('ahead'), does=KEEPS, mends=RESTART)
def clock_ahead(stage: Stage) -> Iterator[None]:
    yield from set_clock(stage, TWO_HOURS_S)


@fault("The computer's clock is set two hours back.", told('back'), does=KEEPS, mends=RESTART)
def clock_back(stage: Stage) -> Iterator[None]:
    yield from set_clock(stage, -TWO_HOURS_S)


@fault(
    "The computer's clock is set two hours back, and photographs have no EXIF time.",
    told('back'),
    does=KEEPS,
    mends=RESTART,
)
def clock_of_files_back(stage: Stage) -> Iterator[None]:
    stage.writes_exif = False
    yield from set_clock(stage, -TWO_HOURS_S)
    stage.writes_exif = True


@fault(
    "The computer's clock is set two hours ahead, and the guard starts again.",
    told('ahead'),
    SupervisorLine('guard ended (-9); starting it again'),
    does=KEEPS,
    mends=RESTART,
)
def clock_ahead_of_a_new_guard(stage: Stage) -> Iterator[None]:
    stage.clock.ahead_s = TWO_HOURS_S
    kill(stage, 'guard')
    yield from set_clock(stage, TWO_HOURS_S)
