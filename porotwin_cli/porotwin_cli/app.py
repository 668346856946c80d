"""The command line as a whole: which commands there are, and how each of them ends."""

import sys

import typer

from porotwin_cli import (
    bench,
    blind_check,
    calibrate,
    convert,
    demo,
    diagnose,
    evaluate,
    image,
    record,
    replay,
    simulate,
    test,
    train,
    up,
)
from porotwin_cli.output import WorkFailed
from porotwin_core.errors import InputError

app = typer.Typer(
    help='PoroTwin: a live digital twin of a FluidFlower rig on ROS 2 Jazzy.',
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
app.command('demo')(demo.command)
app.command('up')(up.command)
app.command('simulate')(simulate.command)
app.command('image')(image.command)
app.command('calibrate')(calibrate.command)
app.command('import')(convert.import_command)
app.command('export')(convert.export_command)
app.command('record')(record.command)
app.command('replay')(replay.command)
app.command('train')(train.command)
app.command('evaluate')(evaluate.command)
app.command('diagnose')(diagnose.command)
app.command('blind-check')(blind_check.command)
app.command('bench')(bench.command)
app.command('test', context_settings={'ignore_unknown_options': True, 'help_option_names': []})(
    test.command
)


def main() -> None:
    """Run the command; exit with 0 done, 1 the work failed, 2 bad input, 130 interrupted."""
    try:
        app(prog_name='porotwin')
    except InputError as error:
        print(f'porotwin: {error}', file=sys.stderr)
        sys.exit(2)
    except (WorkFailed, OSError) as error:  # a full disk, a port in use, a share that went away
        print(f'porotwin: {error}', file=sys.stderr)
        sys.exit(1)
    except KeyboardInterrupt:
        print('porotwin: interrupted', file=sys.stderr)
        sys.exit(130)
