"""The process that diagnoses blindly. It knows a recording, an output folder and excluded effects.

python -m porotwin_validation.blind_process RECORDING OUTPUT WORKERS [EXCLUDED ...]
"""

import sys

from porotwin_diagnosis.examine import examine
from porotwin_diagnosis.report.report_folder import checked_folder, write_diagnosis
from porotwin_recording.recording import open_recording


def main() -> None:
    """Diagnose the recording that the command line names, and write the report."""
    recording, output, workers, *excluded = sys.argv[1:]
    folder = checked_folder(output, [recording])
    result = examine([open_recording(recording)], excluded=excluded, workers=int(workers))
    write_diagnosis(result, folder)


if __name__ == '__main__':
    main()
