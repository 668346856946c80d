"""The class that runs learnt physics is named by a parameter."""

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.model.learnt_solver import solver_named


@pytest.mark.parametrize('name', ['', 'json', 'json:Nothing', 'no_such_package:Solver'])
def test_a_name_without_a_class_is_refused(name: str) -> None:
    with pytest.raises(InputError, match='cannot be loaded'):
        solver_named(name)


def test_a_class_is_found_by_its_name() -> None:
    assert solver_named('fractions:Fraction').__name__ == 'Fraction'
