#!/usr/bin/env bash
# Makes pyvista-vdi visible to a ParaView: an environment for ParaView's Python, which holds this
# package and what it needs, but no second VTK. May be run again: it brings the folder up to date.
#
#   tools/install_paraview.sh FOLDER [WHEEL]
#
#   FOLDER    where the environment goes
#   WHEEL     a wheel of pyvista-vdi; by default this checkout is installed
#
#   PVPYTHON  ParaView's Python (default: pvpython; where it is absent and the system is a Debian,
#             its packages are installed, as root or by sudo)
#   PYTHON    makes the environment; of the same minor version as ParaView's Python (default: the
#             system's, else the one on the PATH)
#   EXTRAS    of pyvista-vdi (default: cpu, which brings an OpenCL implementation)
set -euo pipefail

main() {
    (($# == 1 || $# == 2)) || fail "usage: tools/install_paraview.sh FOLDER [WHEEL]"
    folder=$1
    package=${2:-$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)}
    tools=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
    pvpython=${PVPYTHON:-pvpython}
    [[ -e $package ]] || fail "there is no $package"

    find_paraview
    make_environment
    install_package
    repair_plugin_loader
    check_plugin
    say_how
}

fail() {
    printf 'install_paraview: error: %s\n' "$*" >&2
    exit 1
}

find_paraview() {
    command -v "$pvpython" >/dev/null || install_debian_packages
    version=$(ask 'import sys; print("%d.%d" % sys.version_info[:2])') ||
        fail "$pvpython does not run: try $pvpython --version"
    numpy=$(ask 'import numpy; print(numpy.__version__)') || numpy=
    printf '%s: Python %s, NumPy %s\n' "$("$pvpython" --version)" "$version" "${numpy:-none}"
}

# What a line of Python prints in ParaView's interpreter, without our environment.
ask() {
    env -u PYTHONPATH -u PV_PLUGIN_PATH "$pvpython" -c "$1" 2>/dev/null | tail -n 1
}

install_debian_packages() {
    [[ -z ${PVPYTHON:-} ]] || fail "there is no $PVPYTHON, which PVPYTHON names"
    command -v apt-get >/dev/null ||
        fail "pvpython is not on the PATH: install ParaView, or set PVPYTHON to its pvpython"
    local as_root=()
    ((EUID == 0)) || as_root=(sudo -n)
    export DEBIAN_FRONTEND=noninteractive
    "${as_root[@]}" apt-get update -qq
    # Debian's python3-paraview conflicts with python3-vtk9: never remove what somebody installed
    "${as_root[@]}" apt-get install -y -qq --no-install-recommends --no-remove \
        paraview python3-paraview python3-venv xvfb xauth ||
        fail "Debian's packages paraview and python3-paraview could not be installed"
}

make_environment() {
    local interpreter=${PYTHON:-}
    if [[ -z $interpreter ]]; then
        interpreter=/usr/bin/python$version
        [[ -x $interpreter ]] || interpreter=python$version
    fi
    [[ $(minor_version "$interpreter") == "$version" ]] ||
        fail "ParaView's Python is $version, and $interpreter is not: set PYTHON to a Python $version"
    if [[ -x $folder/bin/python && $(minor_version "$folder/bin/python") != "$version" ]]; then
        fail "$folder holds another Python than ParaView's $version: remove it, or name another folder"
    fi
    "$interpreter" -c 'import ensurepip' 2>/dev/null ||
        fail "$interpreter makes no environments: on Debian and Ubuntu install python3-venv"
    "$interpreter" -m venv "$folder"
    site=$("$folder/bin/python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')
}

minor_version() {
    "$1" -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null || true
}

install_package() {
    # ParaView's own modules see this NumPy, too, and what one major version removed they may use
    local constraints=$folder/constraints.txt
    : >"$constraints"
    [[ -z $numpy ]] || printf 'numpy<%d\n' $((${numpy%%.*} + 1)) >"$constraints"
    local pip=("$folder/bin/python" -m pip --disable-pip-version-check install --quiet)
    local wanted="pyvista-vdi[${EXTRAS-cpu}] @ file://$(realpath "$package")"
    "${pip[@]}" --constraint "$constraints" "$wanted"
    # pip takes another build of the same version for the same
    "${pip[@]}" --force-reinstall --no-deps "$package"
}

# ParaView 5.11.0 imports what Python 3.11 has removed, and then loads no plugin in Python.
repair_plugin_loader() {
    rm -f "$site/sitecustomize.py"
    local said
    said=$("$pvpython" -c 'import paraview.detail.pythonalgorithm' 2>&1) || true
    if [[ $said == *getargspec* ]]; then
        printf 'this ParaView needs inspect.getargspec: sitecustomize.py provides it\n'
        cp "$tools/paraview_sitecustomize.py" "$site/sitecustomize.py"
    fi
}

check_plugin() (
    eval "$("$folder/bin/pyvista-vdi" paraview --environment)"
    "$pvpython" -c 'from paraview.simple import VDISource' || fail "ParaView does not load it"
)

say_how() {
    printf '\nStart ParaView (or pvpython, pvbatch, pvserver) from a shell after\n\n'
    printf '    eval "$(%q paraview --environment)"\n\n' "$(realpath "$folder")/bin/pyvista-vdi"
}

main "$@"
