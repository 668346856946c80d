"""Write the pages of the Python API: python docs/make_api.py FOLDER [PACKAGE...]."""

import sys
import warnings
from pathlib import Path

import pdoc

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = sorted(path.parent.name for path in ROOT.glob('porotwin_*/setup.py'))


def main() -> None:
    """Write one HTML page for each module of the named packages, or of all, into a folder."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else 'site')
    packages = sys.argv[2:] or PACKAGES
    warnings.simplefilter('error', UserWarning)  # pdoc warns about modules it cannot read
    pdoc.render.configure(docformat='google', footer_text='PoroTwin')
    pdoc.pdoc(*packages, output_directory=folder)
    print(f'{folder / "index.html"}')


if __name__ == '__main__':
    main()
