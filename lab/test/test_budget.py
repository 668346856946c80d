"""The budget: how it is counted, and that the checkout keeps it."""

from dataclasses import asdict, replace
from pathlib import Path

from lab.budget import Budget, excesses, measure, read_agreed

MODULE = '''"""A module."""
FIRST, SECOND = 1.0, -2.0
THIRD: float = 3 * 60.0
NAMES = ('a', 'b')
STEPS = (0.5, 'half')
ON = True
lower = 4.0


class Settings:
    """Settings."""

    width: float = 0.5
    name: str = 'x'
    count: int


def act(first: int, share: float = 0.5, *, most: int = 3, name: str = 'x') -> None:
    """Act."""
'''


def test_the_figures_of_a_small_checkout(tmp_path: Path) -> None:
    for name in ('porotwin_a/porotwin_a/module.py', 'porotwin_a/test/test_module.py',
                 'porotwin_a/build/module.py', 'lab/study.py', 'tests/test_all.py'):  # fmt: skip
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(MODULE)
    found, lines = measure(tmp_path), MODULE.count('\n')
    assert found.numbers == 5  # FIRST, SECOND, THIRD, STEPS and width
    assert found.function_defaults == 2
    assert (found.installed_lines, found.product_lines) == (lines, 2 * lines)
    assert found.test_lines == 2 * lines
    assert (found.median_file, found.median_function) == (lines, 2)


def test_a_figure_above_the_agreed_one_is_named() -> None:
    found = Budget(0, 0, 0, 0, 0, 0.0, 0.0)
    agreed = asdict(found)
    assert excesses(found, agreed) == []
    assert excesses(replace(found, numbers=3), agreed) == [
        'numbers: 3, above the agreed 0; a new one replaces an old one'
    ]


def test_the_checkout_keeps_its_budget() -> None:
    assert excesses(measure(), read_agreed()['agreed']) == []
