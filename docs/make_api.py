"""Write the pages of the Python API from the docstrings: python docs/make_api.py FOLDER."""

import sys
import warnings
from pathlib import Path

import pdoc

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = sorted(path.parent.name for path in ROOT.glob('porotwin_*/setup.py'))


def main() -> None:
    """Write one HTML page for each module into the folder named on the command line."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else 'site')
    warnings.simplefilter('error', UserWarning)  # pdoc warns about modules it cannot read
    pdoc.render.configure(docformat='google', footer_text='PoroTwin')
    pdoc.pdoc(*PACKAGES, output_directory=folder)
    print(f'{folder / "index.html"}')


if __name__ == '__main__':
    main()
