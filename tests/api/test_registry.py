"""Other packages add to this one: the example of ``docs/extending.md``, and what goes wrong."""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from fresh_python import run_python

import pyvista_vdi as pvdi
from pyvista_vdi import registry

EXAMPLE = Path(__file__).parents[2] / "examples" / "extension"


def installed(folder, points):
    """Write what pip writes of a distribution with entry points of the group."""
    about = folder / "example-0.1.dist-info"
    about.mkdir(parents=True)
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: example\nVersion: 0.1\n")
    (about / "entry_points.txt").write_text(f"[{registry.GROUP}]\n{points}\n")
    return os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])


def test_the_example_of_the_documentation_works(tmp_path):
    if not EXAMPLE.is_dir():
        pytest.skip("the examples are not beside the tests")
    shutil.copytree(EXAMPLE / "vdi_cube", tmp_path / "vdi_cube")
    point = re.search(r'^cube = "(.+)"$', (EXAMPLE / "pyproject.toml").read_text(), re.M)[1]
    values = np.arange(24.0).reshape(2, 3, 4)  # x is the slowest
    axes = "2 0.5 0 0\n3 0 1 0\n4 0 0 2\n"
    numbers = " ".join(map(str, values.ravel()))
    (tmp_path / "a.cube").write_text(f"a\nb\n1 -1 0 1\n{axes}6 6.0 0 0 0\n{numbers}\n")
    (tmp_path / "b.cube").write_text("nothing")
    done = run_python(
        "import sys, pyvista_vdi as pvdi\n"
        "from pyvista_vdi.cli import main\n"
        "volume = pvdi.read_cube(sys.argv[1])\n"
        "print(volume.dimensions, volume.spacing, volume.origin, volume.array[3, 2, 1])\n"
        "assert 'read_cube' in pvdi.__all__\n"
        "assert main(['info', sys.argv[1]]) == 0\n"
        "assert main(['histogram', sys.argv[1], '--bins', '2']) == 0\n"
        "assert main(['histogram', '--help']) == 0\n"
        "assert main(['histogram', sys.argv[2]]) == 1\n",
        str(tmp_path / "a.cube"),
        str(tmp_path / "b.cube"),
        PYTHONPATH=installed(tmp_path, f"cube = {point}"),
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("(2, 3, 4) (0.5, 1.0, 2.0) (-1.0, 0.0, 1.0) 23.0\n")
    assert "density, float32" in done.stdout
    assert "0 to 11.5: 12\n11.5 to 23: 12\n" in done.stdout
    assert "Print how often a volume has which values." in done.stdout
    assert "b.cube is no cube file" in done.stderr


def test_one_that_fails_is_left_out_with_a_warning(tmp_path):
    (tmp_path / "broken.py").write_text("EXTENSION = 5\n")
    done = run_python(
        "import warnings\n"
        "import pyvista_vdi as pvdi\n"
        "from pyvista_vdi import registry\n"
        "with warnings.catch_warnings(record=True) as caught:\n"
        "    warnings.simplefilter('always')\n"
        "    found = registry.extensions()\n"
        "print(sorted(found), *(each.message for each in caught), sep='\\n')\n",
        PYTHONPATH=installed(tmp_path, "one = broken:EXTENSION\ntwo = absent:EXTENSION"),
    )
    assert done.returncode == 0, done.stderr
    names, one, two = done.stdout.splitlines()
    assert names == repr(sorted(registry.extensions()))
    assert one.startswith("the extension 'one' is left out: TypeError: broken:EXTENSION is no")
    assert two.startswith("the extension 'two' is left out: ModuleNotFoundError: No module named")


REST = """
import numpy as np
import pyvista_vdi as pvdi
from pyvista_vdi.io import vdi_file
from pyvista_vdi.registry import Extension, FileFormat

read, read_info = vdi_file.read, vdi_file.read_info

class Cells:
    values = np.linspace(0, 1, 60, dtype=np.float32).reshape(3, 4, 5)

def volume_of(data, scalars, preference):
    return pvdi.Volume(data.values)

def input_of(data):
    from pyvista_vdi.vtk_pipeline.filters.inputs import Input
    return Input(pvdi.read("a.lists"))

def write(vdi, path, *, progress=None, **options):
    return vdi_file.write(vdi, path, **options)

def size_of(plotter, factor):
    return factor * plotter.window_size[0]

EXTENSION = Extension(
    volumes={"rest:Cells": "rest:volume_of"},
    shown={"rest:Cells": "rest:input_of"},
    formats=(
        FileFormat(".lists", "rest", compressions=("zstd", "none")),
        FileFormat(".plain", "rest"),
    ),
    methods={"plotter.vdi.size_of": "rest:size_of"},
)
"""


def test_data_files_and_methods_of_others(tmp_path):
    pytest.importorskip("pyvista")
    (tmp_path / "rest.py").write_text(REST)
    done = run_python(
        "import os, sys\n"
        "os.chdir(sys.argv[1])\n"
        "import pyvista as pv, pyvista_vdi as pvdi, rest\n"
        "table = pvdi.TransferFunction([(0, 0, 0), (1, 1, 1)], [0, 0.5], (0, 1))\n"
        "camera = pvdi.Camera((2, 2, 20), (2, 2, 1), (0, 1, 0))\n"
        "vdi = pvdi.generate(rest.Cells(), camera, (8, 6), transfer_function=table)\n"
        "vdi.save('a.lists', compression='zstd')\n"
        "assert pvdi.read('a.lists').equals(vdi)\n"
        "try:\n"
        "    vdi.save('a.lists', compression='lz4')\n"
        "except pvdi.InvalidArgumentError as error:\n"
        "    print(error)\n"
        "vdi.save('a.plain', level=None)\n"
        "assert pvdi.read('a.plain').equals(vdi)\n"
        "try:\n"
        "    vdi.save('a.plain', compression='zstd')\n"
        "except pvdi.InvalidArgumentError as error:\n"
        "    print(error)\n"
        "mapper = pvdi.VDIMapper()\n"
        "mapper.SetInputData(rest.Cells())\n"
        "assert mapper.GetVDI().equals(vdi)\n"
        "plotter = pv.Plotter(off_screen=True, window_size=(40, 30))\n"
        "assert plotter.vdi.size_of(2) == 80 and 'size_of' in dir(plotter.vdi)\n"
        "assert not hasattr(plotter.vdi, 'nothing')\n",
        str(tmp_path),
        PYTHONPATH=installed(tmp_path, "rest = rest:EXTENSION"),
    )
    assert done.returncode == 0, done.stderr
    assert "compression of" in done.stdout
    assert "must be one of zstd and none; got 'lz4'" in done.stdout
    assert "a.plain is written with the options none; got compression" in done.stdout


def test_what_is_left_out_takes_along_what_requires_it(tmp_path):
    (tmp_path / "chain.py").write_text(
        "from pyvista_vdi.registry import Extension\n"
        "FIRST, SECOND, THIRD = (Extension(requires=r) for r in (('b',), ('c',), ('absent',)))\n"
        "FOURTH = Extension(requires=('series',))\n"
    )
    points = ("a = chain:FIRST", "b = chain:SECOND", "c = chain:THIRD", "d = chain:FOURTH")
    done = run_python(
        "from pyvista_vdi import registry\nprint(sorted(registry.extensions()))\n",
        PYTHONPATH=installed(tmp_path, "\n".join(points)),
    )
    assert done.returncode == 0, done.stderr
    there = set(registry.extensions())
    assert done.stdout.strip() == repr(sorted(there | {"d"} if "series" in there else there))


@pytest.mark.parametrize(
    ("install", "remedy"),
    [("", r"install it, or"), ("pip install lists", r"install it by pip install lists, or")],
)
def test_what_a_format_needs_is_said_with_its_own_remedy(install, remedy):
    lists = registry.FileFormat(".lists", "absent_lists", needs="lists", install=install)
    with pytest.raises(pvdi.MissingDependencyError, match=rf"\.lists files need lists.*{remedy}"):
        lists.load()


def test_what_no_extension_has_is_said_by_name():
    with pytest.raises(pvdi.MissingDependencyError, match="by flight is of an extension"):
        registry.generator("flight")
    assert registry.method("VDI.flight", 5) == 5
    assert registry.made_of("volumes", 3) is None
