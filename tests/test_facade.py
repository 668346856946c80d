"""`import porotwin`: Python and the type checker see the same names, which load when used."""

import ast
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

import numpy as np  # noqa: F401  its BLAS is here before a limit is set
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import porotwin

SOURCE = Path(porotwin.__file__).read_text(encoding='utf-8')


def test_the_type_checker_and_python_see_the_same_names() -> None:
    (typed,) = (
        part.body
        for part in ast.parse(SOURCE).body
        if isinstance(part, ast.If) and ast.unparse(part.test) == 'TYPE_CHECKING'
    )
    imported = {
        (alias.name, part.module)
        for part in typed
        if isinstance(part, ast.ImportFrom)
        for alias in part.names
    }
    places = (place.partition(':') for place in porotwin.PLACES.values())
    named = zip(porotwin.PLACES, places, strict=True)
    assert imported == {(own or name, module) for name, (module, _, own) in named}


@pytest.mark.parametrize('name', porotwin.NAMES)
def test_every_name_loads(name: str) -> None:
    assert getattr(porotwin, name) is not None
    assert name in dir(porotwin)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match='open_recording'):
        _ = porotwin.open_bag


def test_the_import_alone_loads_no_large_library() -> None:
    script = 'import sys, porotwin; print(*{"numpy", "torch", "cv2", "rclpy"} & {*sys.modules})'
    ran = subprocess.run([sys.executable, '-c', script], capture_output=True, text=True, check=True)
    assert ran.stdout.split() == []


def test_a_missing_extra_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(porotwin.PLACES, 'nothing', 'porotwin_core.no_such_module')
    with pytest.raises(porotwin.InputError, match=r'nothing.*pip install'):
        _ = porotwin.nothing


class Probe:
    """An argument that tells with how many threads of BLAS it is looked at."""

    def tell(self, *_arguments: object) -> NoReturn:
        threads = {pool['num_threads'] for pool in threadpool_info() if pool['user_api'] == 'blas'}
        raise InterruptedError(threads)

    __getattr__ = __getitem__ = __iter__ = __len__ = tell


@pytest.mark.parametrize(
    'work',
    [
        lambda one: porotwin.simulate(one, one, one, grid=one),
        lambda one: porotwin.diagnose(one),
        lambda one: porotwin.train(one, one, one, seed=1),
    ],
    ids=['simulate', 'diagnose', 'train'],
)
def test_long_work_keeps_to_one_thread_of_blas(work: Callable[[Probe], object]) -> None:
    with threadpool_limits(limits=2, user_api='blas'):
        with pytest.raises(InterruptedError, match=r'^\{1\}$'):
            work(Probe())
        with pytest.raises(InterruptedError, match='2'):
            Probe().tell()
