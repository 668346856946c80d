"""Fixtures of the tests of this package; see tests/fixtures/diagnosis_examples.py."""

from diagnosis_examples import denser_sand, quiet

__all__ = ['denser_sand', 'quiet']
