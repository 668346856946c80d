"""The command line: its commands, their help, and one line for wrong input."""

import errno
import subprocess
import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest
import typer
from cli_examples import porotwin
from typer.testing import CliRunner

import porotwin_cli.app
from porotwin_cli import commands
from porotwin_cli.app import (
    DISK_FULL,
    HELP_OPTIONS,
    app,
    command_folders,
    make_app,
    refuse_empty_paths,
    refuse_unreadable_names,
)
from porotwin_core.basis.errors import InputError

GROUP = typer.main.get_command(app)
COMMANDS = sorted(GROUP.commands)
PARTS = [
    (name, part) for name in COMMANDS for part in getattr(GROUP.commands[name], 'commands', ())
]
"""Commands with parts, and each of their parts."""

CALLS = [*((name,) for name in COMMANDS), *PARTS]

OF_LAB = {'bench', 'blind-check', 'experiment'}
"""Commands of a checkout alone."""

HEAVY = ('matplotlib', 'netCDF4', 'numba', 'rclpy', 'scipy', 'torch')
"""Packages that take long to import."""


def test_every_module_of_the_folder_is_a_command() -> None:
    folders = [Path(folder.__path__[0]) for folder in command_folders()]
    files = {path.stem for folder in folders for path in folder.glob('*.py')} - {'__init__'}
    assert {name.strip('_').replace('_', '-') for name in files} == set(COMMANDS)
    assert {'blind-check', 'demo', 'import', 'test', 'up'} < set(COMMANDS)


def test_a_module_without_a_command_costs_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / 'unfinished.py').write_text('"""A command to come."""\n')
    monkeypatch.setattr(commands, '__path__', [str(tmp_path)])
    assert {str(command.name) for command in make_app().registered_commands} <= OF_LAB
    line = capsys.readouterr().err.strip()
    assert line.endswith('unfinished.py: no function `command`; see commands/__init__.py')
    assert '\n' not in line


def test_a_command_of_another_package_that_fails_costs_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    group = 'porotwin_cli.commands'
    added = [EntryPoint('demo', 'os', group), EntryPoint('broken', 'no_such_module', group)]
    monkeypatch.setattr(porotwin_cli.app, 'installed', lambda _group: added)
    porotwin_cli.app.added_modules.cache_clear()
    try:
        assert set(porotwin_cli.app.command_modules()) == set(COMMANDS)
    finally:
        porotwin_cli.app.added_modules.cache_clear()
    clash, broken = capsys.readouterr().err.splitlines()
    assert 'there is a demo already' in clash
    assert "No module named 'no_such_module'" in broken


def test_an_installed_program_lacks_the_commands_of_the_laboratory(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(porotwin_cli.app, 'LAB', 'no_such_laboratory')
    group = typer.main.get_command(make_app())
    assert set(COMMANDS) - set(group.commands) == OF_LAB


@pytest.mark.parametrize('option', HELP_OPTIONS)
def test_the_list_of_commands_has_both_options_of_help(option: str) -> None:
    result = CliRunner().invoke(app, [option], prog_name='porotwin')
    assert result.exit_code == 0
    assert 'Commands:' in result.stdout


@pytest.mark.parametrize('option', HELP_OPTIONS)
@pytest.mark.parametrize('call', CALLS, ids=' '.join)
def test_every_command_has_help_with_an_example(call: tuple[str, ...], option: str) -> None:
    result = CliRunner().invoke(app, [*call, option], prog_name='porotwin')
    assert result.exit_code == 0
    assert f'Example: ./porotwin {" ".join(call)}' in ' '.join(result.stdout.split())


@pytest.mark.parametrize('call', CALLS, ids=' '.join)
def test_every_option_is_explained(call: tuple[str, ...]) -> None:
    result = CliRunner().invoke(app, [*call, '--help'], prog_name='porotwin')
    options = [line for line in result.stdout.splitlines() if line.startswith('  -')]
    documented = ' '.join(result.stdout.split())
    assert options
    for line in options:
        name = line.split()[0].rstrip(',')
        assert len(documented.split(name, 1)[1].split()) > 2, name


def test_the_list_of_commands_says_what_each_does() -> None:
    result = CliRunner().invoke(app, ['--help'], prog_name='porotwin')
    assert result.exit_code == 0
    assert 'Exit status: 0 done, 1 the work failed, 2 wrong input' in result.stdout
    for name in COMMANDS:
        first = (GROUP.commands[name].help or '').splitlines()[0]
        assert first.endswith('.'), name
        assert f'  {name}' in result.stdout


def test_help_needs_no_large_package() -> None:
    code = (
        'import sys; import porotwin_cli.app; '
        f'print([name for name in {HEAVY} if name in sys.modules])'
    )
    result = subprocess.run(
        [sys.executable, '-c', code], capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() == '[]'


@pytest.mark.parametrize(
    ('arguments', 'named'),
    [
        (['simulate', 'nowhere', '--output', 'x.nc'], 'nowhere'),
        (['export', 'nowhere', 'there'], 'nowhere'),
        (['replay', 'nowhere'], 'nowhere'),
        (['image', 'nowhere', '--output', 'x.nc'], 'nowhere'),
        (['up', '--rig', 'nowhere.yaml', '--photos', '.'], 'nowhere.yaml'),
        (['bench', 'nothing'], "'nothing'"),
        (['evaluate', 'nowhere', 'there'], 'nowhere'),
    ],
)
def test_bad_input_is_one_line_and_status_2(arguments: list[str], named: str) -> None:
    result = porotwin(*arguments)
    assert result.returncode == 2, result.stderr
    assert named in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
    assert result.stdout == ''


@pytest.mark.parametrize(
    'arguments',
    [
        ['bench', 'physics', '--seed'],
        ['blind-check', '--output', 'blind', '--seed'],
        ['demo', '--seed'],
        ['experiment', 'diffusive', '--seed'],
        ['train', 'recording', '--output', 'model', '--seed'],
    ],
)
@pytest.mark.parametrize('seed', ['-1', '1e3', str(2**63)])
def test_a_seed_that_generators_do_not_take_is_refused(arguments: list[str], seed: str) -> None:
    result = porotwin(*arguments, seed)
    assert result.returncode == 2
    assert "Invalid value for '--seed'" in result.stderr


@pytest.mark.parametrize(
    'arguments',
    [
        ['bench', 'faults', '--hours'],
        ['check', 'rig.yaml', '--photo-interval-s'],
        ['demo', '--minutes'],
        ['experiment', 'complex', '--cell-mm'],
        ['experiment', 'complex', '--hours'],
        ['experiment', 'diffusive', '--minutes'],
        ['up', '--rig', 'rig.yaml', '--horizon-s'],
        ['up', '--rig', 'rig.yaml', '--photo-interval-s'],
    ],
)
@pytest.mark.parametrize('number', ['nan', 'inf', '1e300'])
def test_a_time_or_length_without_end_is_refused(arguments: list[str], number: str) -> None:
    result = porotwin(*arguments, number)
    assert result.returncode == 2
    assert f"Invalid value for '{arguments[-1]}'" in result.stderr


def test_a_full_disk_ends_with_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full() -> None:
        raise OSError(errno.ENOSPC, 'No space left on device')

    writer = typer.Typer()
    writer.command()(full)
    monkeypatch.setattr(porotwin_cli.app, 'app', writer)
    monkeypatch.setattr(sys, 'argv', ['porotwin'])
    with pytest.raises(SystemExit) as end:
        porotwin_cli.app.run()
    assert end.value.code == 1
    assert capsys.readouterr().err.strip() == f'porotwin: {DISK_FULL}'


def test_a_name_that_is_not_utf_8_is_refused_before_any_work() -> None:
    refuse_unreadable_names(['simulate', 'Messung Süd', '--output', 'Modell.nc'])
    with pytest.raises(InputError, match=r'^caf\\udce9: this name is not UTF-8'):
        refuse_unreadable_names(['check', b'caf\xe9'.decode(errors='surrogateescape')])


def test_a_name_of_two_lines_is_refused_before_any_work() -> None:
    with pytest.raises(InputError, match=r'^my\\nrig: this name holds a line break'):
        refuse_unreadable_names(['check', 'my\nrig'])


def test_an_experiment_folder_is_not_exported_again(tmp_path: Path) -> None:
    (tmp_path / 'rig.yaml').touch()
    result = porotwin('export', tmp_path, tmp_path / 'out')
    assert result.returncode == 2
    assert 'is an experiment folder already' in result.stderr
    assert not (tmp_path / 'out').exists()


def test_a_part_is_cut_out_of_the_folder_of_a_rig_yaml(experiment: Path, tmp_path: Path) -> None:
    result = porotwin('export', experiment / 'rig.yaml', tmp_path / 'part', '--times', ':60')
    assert result.returncode == 0, result.stderr
    assert (tmp_path / 'part' / 'rig.yaml').is_file()


@pytest.mark.parametrize(
    ('arguments', 'refused'),
    [
        (('diagnose', 'run', '--output', ''), '--output'),
        (('diagnose', 'run', '--output='), '--output'),
        (('diagnose', '', '--output', 'report'), 'an argument'),
        (('bench', 'loop', '--output', ''), '--output'),
        (('up', '--rig', 'rig.yaml', '--page', ''), ''),
        (('simulate', 'run', '--effect', '', '--output', 'model.nc'), ''),
        ((), ''),
    ],
)
def test_an_empty_path_is_refused_because_the_shell_may_lack_a_variable(arguments, refused) -> None:
    if not refused:
        refuse_empty_paths(arguments)
        return
    with pytest.raises(InputError, match=f'^{refused}: is empty'):
        refuse_empty_paths(arguments)
