"""The process that diagnoses blindly. It knows a recording, an output folder and excluded effects.

python -m lab.blind.blind_process RECORDING OUTPUT [EXCLUDED ...]
"""

import sys

from porotwin_core.basis.parent import end_with_parent
from porotwin_diagnosis.examine import DiagnosisSettings, examine
from porotwin_diagnosis.report.report_folder import checked_folder, write_diagnosis
from porotwin_recording.experiment.recording import open_recording


def main() -> None:
    """Diagnose the recording that the command line names, and write the report.

    Lines on standard output tell the share of the work that is done.
    """
    end_with_parent()  # a case whose worker was killed begins anew
    recording, output, *excluded = sys.argv[1:]
    folder = checked_folder(output, [recording])
    result = examine(
        [open_recording(recording)], DiagnosisSettings(excluded=excluded, progress=_tell)
    )
    write_diagnosis(result, folder)


def _tell(_stage: str, share: float) -> None:
    print(f'{share:.4f}', flush=True)


if __name__ == '__main__':
    main()
