"""NetCDF files that harm whoever opens them."""

import zlib
from base64 import b85decode
from pathlib import Path

import netCDF4
import pytest

from porotwin_core.basis import netcdf_file
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.netcdf_file import open_netcdf

ENDLESS = zlib.decompress(b85decode(
    b'c-rk%&rcIU6n-'
    b';pNmG}CxTGK^uEdizO)1rIX$sjcw4rQG3o$V!&EhU$6WWq?MT5WM(TfM;$%97^9yodMh#LP56Jz2P{R?nrXNI;5J'
    b'#aBW=S$nk?0Ylsd*6F+`=VG_9FAR#;b;^D4mn_o?bG~u#eVm(QY=)l@&Ql#PeP%<ksx9i5Venv(%+vE=H1|@hE)2'
    b'C!iewD!&%HN6U@T55V4(YZ}R~UH+~7iG&&j>7vgXXdrw+#eEP$42>FpQLP(@7){sgWpTBb14*{S-'
    b'A_|FTl!Kp3D8_R6%*^l#`Z<LMa#F7Q_rnm0MO^jrLahcDs5q1g`4&nmhFL3B%z8~<C>x;MArg=S5q7{_STTJ6dG5'
    b'cu>2@^ov9zY+>4injb{kH!<F=aG`h8Dpw!E%s$7;LQ`j(T@1m=Je!sPxqDD?ii>3H|-'
    b'jcmbfxHgOuL4*SMNW;lbUvD4RP~lePlp3x^&bEd#nbT>=`rQ8Ue4lBUN9d}rA@25}66nW(rdpm`<{^6yvWH|MB5_'
    b'~SYuy2UyA&M*HXsw?c)!AUu)+p&S4m{Gn~>gWwQaX)c}}N4EmD5b9=K=NXsXIxru_)1j@nzAa;dfole}sPp6p3Cp'
    b'&lhrU{8I<yz%!Hy|^sW6-j79ye*mvWss%}s>Y&GHB8-'
    b'L3~pk^z_vWA<9J;vM?C;hYVXYz^)e$6uOxw|zkel9VwC>tjKqHG<>O__NW5&1DztkbIPsFl*^Jap{Z_lR?X*3Y6q'
    b'^pqG?#nFX;TilOtR^BMJ}6~NvCF#oA$<yTqc!CrN4by^FZS4U`el(**|oD*FfMkbP$+K@q8Bd`|poPO(i5GBqSsx'
    b'BqSsxBqSvMRXkGnmcH-4&dXJ<|Ks`x@im=1'
))  # fmt: skip
"""A map of a property with damaged bytes: HDF5 1.14 never ends to open it."""


@pytest.fixture
def whole(tmp_path: Path) -> Path:
    path = tmp_path / 'whole.nc'
    with netCDF4.Dataset(path, 'w') as dataset:
        dataset.createDimension('x', 3)
        dataset.createVariable('depth', 'f8', ('x',))[:] = 0.02
    return path


@pytest.fixture
def taster(monkeypatch: pytest.MonkeyPatch) -> netcdf_file.Taster:
    """Let the other process begin here, and give up early."""
    monkeypatch.setattr(netcdf_file, 'LONGEST_OPEN_S', 1)
    own = netcdf_file.Taster()
    monkeypatch.setattr(netcdf_file, '_taster', own)
    return own


def test_a_file_whose_opening_never_ends_is_refused(
    whole: Path, taster: netcdf_file.Taster
) -> None:
    damaged = whole.with_name('damaged.nc')
    damaged.write_bytes(ENDLESS)
    for _ in range(2):
        with pytest.raises(InputError, match='opens it for more than'):
            open_netcdf(damaged)
        with open_netcdf(whole) as dataset:
            assert dataset['depth'].shape == (3,)
    taster.end()


def test_no_module_of_the_folder_of_work_is_loaded(
    whole: Path, taster: netcdf_file.Taster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / 'json.py').write_text('open("ran", "w")')
    monkeypatch.chdir(tmp_path)
    open_netcdf(Path(whole.name)).close()
    assert not (tmp_path / 'ran').exists()
    taster.end()


def test_another_process_is_asked_after_one_has_ended(
    whole: Path, taster: netcdf_file.Taster
) -> None:
    open_netcdf(whole).close()
    taster.end()
    open_netcdf(whole).close()
    taster.end()
