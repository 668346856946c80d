"""The running twin of a part of the fault suite."""

from collections.abc import Iterator

import pytest

from faults.suite import Stages


@pytest.fixture(scope='module')
def stages(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory, new_domain: object
) -> Iterator[Stages]:
    settable = getattr(request.module, 'SETTABLE_CLOCK', False)
    stages = Stages(tmp_path_factory, new_domain, settable=settable)
    yield stages
    stages.close()
