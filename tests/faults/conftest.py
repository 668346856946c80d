"""The running twin of a part of the fault suite."""

from collections.abc import Iterator

import pytest

from faults.suite import Stages


@pytest.fixture(scope='module')
def stages(tmp_path_factory: pytest.TempPathFactory, new_domain: object) -> Iterator[Stages]:
    stages = Stages(tmp_path_factory, new_domain)
    yield stages
    stages.close()
