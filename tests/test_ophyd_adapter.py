"""The adapter of the examples for Bluesky: a plan reads the newest numbers of the twin.

ophyd-async needs other versions of our libraries, so that it has an environment of its own. This
test needs nothing of ours: pip install ophyd-async bluesky pytest.
"""

import runpy
from pathlib import Path
from typing import Any

import pytest

bluesky = pytest.importorskip('bluesky', reason='no ophyd-async beside our libraries')

ADAPTER = Path(__file__).resolve().parents[1] / 'examples/adapters/ophyd_device.py'


def test_a_plan_reads_the_newest_numbers() -> None:
    from bluesky.plans import count
    from ophyd_async.core import init_devices

    engine = bluesky.RunEngine()
    newest = {'control1_ml_h': 100.0, 'prediction_error': 0.25}
    with init_devices():
        twin = runpy.run_path(str(ADAPTER))['Twin'](newest, {**dict.fromkeys(newest, '')})
    newest['control1_ml_h'] = 200.0
    told: list[tuple[str, dict[str, Any]]] = []
    engine(count([twin]), lambda name, document: told.append((name, document)))
    (event,) = [document for name, document in told if name == 'event']
    assert event['data'] == {'twin-control1_ml_h': 200.0, 'twin-prediction_error': 0.25}
