"""The settings of the steps are immutable, and every one has a reason."""

import ast
from pathlib import Path

import porotwin_imaging

GROUPS = [
    group
    for path in sorted(Path(porotwin_imaging.__file__).parent.rglob('*.py'))
    for group in ast.parse(path.read_text(encoding='utf-8')).body
    if isinstance(group, ast.ClassDef) and group.name.endswith('Settings')
]


def test_settings_cannot_be_changed() -> None:
    decorators = {ast.unparse(decorator) for group in GROUPS for decorator in group.decorator_list}
    assert decorators == {'dataclass(frozen=True)'}


def test_every_setting_is_documented() -> None:
    assert GROUPS
    for group in GROUPS:
        for field, following in zip(group.body, [*group.body[1:], None], strict=True):
            if isinstance(field, ast.AnnAssign):
                assert isinstance(following, ast.Expr), ast.unparse(field)
