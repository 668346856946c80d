"""The setup of `.venv`: an environment that was moved, or is of another Python, and its command."""

import importlib.util
import os
import runpy
import shutil
import subprocess
import sys
import venv
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The setup of the checkout `here`, with an environment without pip."""
    spec = importlib.util.spec_from_file_location('install', ROOT / 'setup' / 'install.py')
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, 'install', module)
    spec.loader.exec_module(module)
    builder = venv.EnvBuilder
    monkeypatch.setattr(module.venv, 'EnvBuilder', lambda **_: builder(with_pip=False))
    in_checkout(module, tmp_path / 'here')
    module.STAMPS.mkdir(parents=True)
    module.make_environment()
    (module.VENV / 'bin' / 'colcon').write_text(f'#!{module.PYTHON}\n')
    return module


def in_checkout(install: ModuleType, folder: Path) -> None:
    """Let `install` set up the checkout `folder`."""
    install.VENV = folder / '.venv'
    install.PYTHON = install.VENV / 'bin' / 'python'
    install.STAMPS = install.VENV / 'porotwin'


def test_another_call_keeps_the_scripts_of_the_environment(install: ModuleType) -> None:
    install.make_environment()
    assert (install.VENV / 'bin' / 'colcon').is_file()


def test_scripts_that_name_the_old_place_of_a_checkout_are_removed(
    install: ModuleType, tmp_path: Path
) -> None:
    shutil.move(tmp_path / 'here', tmp_path / 'there')
    in_checkout(install, tmp_path / 'there')
    install.make_environment()
    assert not (install.VENV / 'bin' / 'colcon').exists()
    assert install.PYTHON.is_file()
    assert install.STAMPS.is_dir()


def test_the_environment_of_another_python_is_made_anew(install: ModuleType) -> None:
    settings = install.VENV / 'pyvenv.cfg'
    minor = f'version = 3.{sys.version_info.minor}.'
    settings.write_text(settings.read_text().replace(minor, 'version = 3.9.'))
    install.make_environment()
    assert not (install.VENV / 'bin' / 'colcon').exists()
    subprocess.run([install.PYTHON, '-c', ''], check=True)


def test_a_patch_of_python_or_a_reason_of_a_requirement_repeats_no_step(
    install: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install.ROOT = tmp_path
    requirements = tmp_path / 'some.txt'
    requirements.write_text('# Reads photographs\nopencv>=4\n')
    before = install.fingerprint(['*.txt'])
    requirements.write_text('# Reads pictures\nopencv>=4\n')
    monkeypatch.setattr(sys, 'version', f'{sys.version} of another patch')
    assert install.fingerprint(['*.txt']) == before
    requirements.write_text('# Reads pictures\nopencv>=5\n')
    assert install.fingerprint(['*.txt']) != before


def test_the_command_of_the_environment_runs_in_a_folder_with_a_space(
    install: ModuleType, tmp_path: Path
) -> None:
    shutil.move(tmp_path / 'here', tmp_path / 'my twin')
    in_checkout(install, tmp_path / 'my twin')
    install.link_packages()
    install.PYTHON.unlink()
    install.PYTHON.write_text('#!/bin/sh\necho "$@"\n')
    install.PYTHON.chmod(0o755)
    command = [install.VENV / 'bin' / 'porotwin', 'check', 'my rig']
    found = subprocess.run(command, capture_output=True, text=True, check=True)
    assert found.stdout == '-m porotwin_cli check my rig\n'


def test_a_link_to_the_command_finds_its_checkout_and_its_own_python(tmp_path: Path) -> None:
    checkout = tmp_path / 'checkout'
    (checkout / 'setup').mkdir(parents=True)
    shutil.copy(ROOT / 'porotwin', checkout)
    (checkout / 'setup' / 'install.py').write_text('raise SystemExit(7)')
    link = tmp_path / 'porotwin'
    link.symlink_to(checkout / 'porotwin')
    elsewhere = {**os.environ, 'PYTHONHOME': str(tmp_path)}
    assert subprocess.run([link], check=False, env=elsewhere).returncode == 7


def test_all_files_state_one_version() -> None:
    script = runpy.run_path(str(ROOT / 'setup' / 'set_version.py'))
    assert len(set(script['stated']().values())) == 1


@pytest.mark.filterwarnings('ignore::DeprecationWarning')  # of catkin_pkg with docutils
def test_a_release_has_the_changes_of_each_package() -> None:
    changelog = pytest.importorskip('catkin_pkg.changelog', reason='colcon brings it')
    script = runpy.run_path(str(ROOT / 'setup' / 'make_changelogs.py'))
    text = (ROOT / 'CHANGELOG.md').read_text(encoding='utf-8')
    text = text.replace(
        'Unreleased', '9.9.9 (2036-01-01)'
    )  # the parser passes changes to come over
    found = changelog.Changelog('porotwin_hub')
    changelog.populate_changelog_from_rst(found, script['page']('porotwin_hub', text))
    assert {'9.9.9', '0.2.0', '0.1.0'} <= {version for version, _, _ in found.foreach_version()}
    items = [item for *_, lists in found.foreach_version() for one in lists for item in one.bullets]
    assert len(items) >= text.count('\n- ')


def test_the_command_runs_no_file_of_the_users_folder(tmp_path: Path) -> None:
    for module in ('numpy', 'queue', 'typer'):
        (tmp_path / f'{module}.py').write_text('raise SystemExit("foreign")')
    command = [str(ROOT / 'porotwin'), '--help']
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert 'calibrate' in done.stdout


def test_a_folder_that_is_gone_is_named_as_such(tmp_path: Path) -> None:
    gone = tmp_path / 'gone'
    gone.mkdir()
    done = subprocess.run(
        ['/bin/sh', '-c', f'rmdir {gone} && {ROOT / "porotwin"} --help'],
        cwd=gone,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert 'the folder that you are in is gone' in done.stderr
    assert 'Python' not in done.stderr
