"""Runs the command: `python -m porotwin_cli`, what ./porotwin starts."""

from porotwin_cli.app import main

main()
