"""A package beside PoroTwin adds an effect, a pump and a command: examples/extension."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def test_an_installed_package_adds_an_effect_a_pump_and_a_command(tmp_path: Path) -> None:
    source, site = tmp_path / 'source', tmp_path / 'site'
    shutil.copytree(ROOT / 'examples' / 'extension', source)
    offline = ('--no-deps', '--no-build-isolation', '--no-index', '--disable-pip-version-check')
    install = [*(sys.executable, '-m', 'pip', 'install', '-q'), *offline, '--target', str(site)]
    subprocess.run([*install, str(source)], check=True)
    paths = os.pathsep.join([str(site), os.environ.get('PYTHONPATH', '')])
    ran = subprocess.run(
        [sys.executable, '-m', 'pytest', '-q', '-p', 'no:cacheprovider', str(source / 'test')],
        check=False, capture_output=True, text=True, cwd=tmp_path,
        env={**os.environ, 'PYTHONPATH': paths},
    )  # fmt: skip
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert '3 passed' in ran.stdout
