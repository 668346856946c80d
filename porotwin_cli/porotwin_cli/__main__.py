"""Runs the command line: `python -m porotwin_cli`, which ./porotwin starts."""

from porotwin_cli.interrupts import told_in_one_line
from porotwin_cli.memory_limit import refuse_small_memory


def main() -> None:
    """Run the command; exit with 0 done, 1 the work failed, 2 wrong input, 130 interrupted."""
    refuse_small_memory()
    with told_in_one_line():
        from porotwin_cli.app import run  # loads for half a second

        run()


if __name__ == '__main__':
    main()
