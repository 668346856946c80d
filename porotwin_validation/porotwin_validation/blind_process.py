"""The process that diagnoses blindly: it is told a recording, where to write, what to leave out."""

import sys

from porotwin_diagnosis.examine import diagnose


def main() -> None:
    """Diagnose: RECORDING OUTPUT WORKERS [EXCLUDED ...]."""
    recording, output, workers, *excluded = sys.argv[1:]
    diagnose(recording, output, excluded=excluded, workers=int(workers))


if __name__ == '__main__':
    main()
