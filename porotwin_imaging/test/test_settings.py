"""The settings are immutable, and every one has a reason."""

import ast
import dataclasses
from pathlib import Path

import pytest

from porotwin_imaging import settings


def test_settings_cannot_be_changed() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        settings.DEFAULTS.total_variation.weight_m = 1.0


def test_every_setting_is_documented() -> None:
    module = ast.parse(Path(settings.__file__).read_text(encoding='utf-8'))
    for group in (node for node in module.body if isinstance(node, ast.ClassDef)):
        if group.name == 'ImagingSettings':
            continue
        for field, following in zip(group.body, [*group.body[1:], None], strict=True):
            if isinstance(field, ast.AnnAssign):
                assert isinstance(following, ast.Expr), ast.unparse(field)
