"""Runs the command line: `python -m porotwin_cli`, which ./porotwin starts."""

from porotwin_cli.app import main

main()
