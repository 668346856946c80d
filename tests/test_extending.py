"""The worked examples of docs/extend: each new file works without any other edit.

Every page has fenced blocks whose first line is `# file: PATH` (`// file: PATH` in JavaScript).
The test copies the packages to a temporary folder, writes the files of all pages there, and runs
the tests among them.
"""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted((ROOT / 'docs' / 'extend').glob('*.md'))
BLOCK = re.compile(r'^```\w*\n(?:#|//) file: (\S+)\n(.*?)^```', re.MULTILINE | re.DOTALL)
KINDS = {'effect', 'objective', 'network', 'source', 'panel'}


def test_every_extension_point_has_a_worked_example() -> None:
    assert {page.stem for page in PAGES} >= KINDS


def test_new_files_are_all_that_extensions_need(tmp_path: Path) -> None:
    packages = sorted(path.parent for path in ROOT.glob('porotwin_*/setup.py'))
    for package in packages:
        shutil.copytree(package, tmp_path / package.name)
    shutil.copytree(ROOT / 'tests' / 'fixtures', tmp_path / 'tests' / 'fixtures')
    for name in ('pyproject.toml', 'conftest.py'):
        shutil.copy2(ROOT / name, tmp_path)
    tests = [name for page in PAGES for name in written(page, tmp_path)]
    paths = os.pathsep.join(str(tmp_path / package.name) for package in packages)
    ran = subprocess.run(
        [sys.executable, '-m', 'pytest', '-q', '-p', 'no:cacheprovider', *tests],
        check=False, capture_output=True, text=True, cwd=tmp_path,
        env={**os.environ, 'PYTHONPATH': paths},
    )  # fmt: skip
    assert ran.returncode == 0, ran.stdout + ran.stderr


def written(page: Path, folder: Path) -> list[str]:
    """Write the files of a page into `folder`; return the names of the tests among them."""
    files = dict(BLOCK.findall(page.read_text(encoding='utf-8')))
    tests = [name for name in files if Path(name).name.startswith('test_')]
    assert tests, f'{page}: has no block "# file: .../test_*.py"'
    for name, text in files.items():
        path = folder / name
        assert not path.exists(), f'{page}: {name} exists already; the example must be a new file'
        path.write_text(text, encoding='utf-8')
    return tests
