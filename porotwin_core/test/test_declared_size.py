"""Tests of the limit of claimed sizes."""

import math

import pytest

from porotwin_core.basis.declared_size import LARGEST_BYTES, check_declared
from porotwin_core.basis.errors import InputError


def test_sizes_up_to_the_limit_are_read_and_larger_ones_refused() -> None:
    check_declared('maps.nc', (LARGEST_BYTES // 8, 8))
    check_declared('maps.nc', (0, 10**30))
    for sizes in ((LARGEST_BYTES // 8 + 1, 8), (10**30, 10**300), (math.inf,)):
        with pytest.raises(InputError, match=r'maps\.nc: claims .* bytes'):
            check_declared('maps.nc', sizes)
