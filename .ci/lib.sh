# Steps shared by .ci/run and .ci/nightly; sourced with $checkout set.
# shellcheck shell=bash

python=${PYTHON:-python3}
export CI=${CI:-true}
export PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_NO_INPUT=1 PIP_ROOT_USER_ACTION=ignore
export PYTHONDONTWRITEBYTECODE=1
# Off-screen rendering without a display; VTK chooses its window by this
export VTK_DEFAULT_OPENGL_WINDOW=${VTK_DEFAULT_OPENGL_WINDOW:-vtkEGLRenderWindow}
export PYVISTA_OFF_SCREEN=true
# A machine without an OpenCL device fails the tests that need one instead of skipping them
export PYVISTA_VDI_REQUIRE_DEVICE=1
# One without a browser does so, too
export PYVISTA_VDI_REQUIRE_BROWSER=1
# The tests refuse to run on the sources of a checkout
export PYVISTA_VDI_REQUIRE_INSTALLED=1
# Tests of the distributions compare them with the files of the checkout
export PYVISTA_VDI_CHECKOUT=$checkout
# git reads a checkout that somebody else owns, as in a container
export GIT_CONFIG_COUNT=1 GIT_CONFIG_KEY_0=safe.directory GIT_CONFIG_VALUE_0='*'

if [[ -z ${PYVISTA_VDI_DATA:-} && -d $checkout/../shared/data ]]; then
    PYVISTA_VDI_DATA=$(cd "$checkout/../shared/data" && pwd)
    export PYVISTA_VDI_DATA
fi

results=()
failed=0
status=0 # of the last step

log() { printf '%s\n' "-- $*"; }

# Run a step in a shell of its own, so that its first failing command ends it; note time and result.
run_step() {
    local name=$1 start=$SECONDS
    shift
    printf '\n==== %s\n' "$name"
    set +e
    (set -euo pipefail && "$@") </dev/null
    status=$?
    set -e
    if ((status == 0)); then
        results+=("$(printf 'passed  %-20s %5d s' "$name" $((SECONDS - start)))")
    else
        results+=("$(printf 'FAILED  %-20s %5d s  (status %d)' "$name" $((SECONDS - start)) "$status")")
        failed=1
    fi
    printf '==== %s\n' "${results[-1]}"
}

# A step that others do not need: left out where CI_ONLY does not name it.
step() {
    if [[ -z ${CI_ONLY:-} || " $CI_ONLY " == *" $1 "* ]]; then
        run_step "$@"
    fi
}

# Steps that use one core each, side by side: NAME:FUNCTION ... What the last one prints comes at once,
# what the others print after it, one by one.
steps_together() {
    local pair name start last wanted=()
    for pair in "$@"; do
        [[ -z ${CI_ONLY:-} || " $CI_ONLY " == *" ${pair%%:*} "* ]] && wanted+=("$pair")
    done
    ((${#wanted[@]})) || return 0
    last=${wanted[-1]}
    unset 'wanted[-1]'
    for pair in ${wanted[@]+"${wanted[@]}"}; do
        name=${pair%%:*}
        (
            start=$SECONDS
            set +e
            (set -euo pipefail && "${pair#*:}") </dev/null >"$work/$name.log" 2>&1
            printf '%d %d' $? $((SECONDS - start)) >"$work/$name.status"
        ) &
    done
    run_step "${last%%:*}" "${last#*:}"
    wait
    for pair in ${wanted[@]+"${wanted[@]}"}; do
        name=${pair%%:*}
        run_step "$name" said_before "$name"
        results[-1]+="  ($(cut -d' ' -f2 "$work/$name.status") s beside others)"
    done
}

said_before() {
    cat "$work/$1.log"
    return "$(cut -d' ' -f1 "$work/$1.status")"
}

# A step without which the following ones make no sense.
required_step() {
    run_step "$@"
    ((status == 0)) || summarise
}

summarise() {
    printf '\n==== summary, %d s in all\n' "$SECONDS"
    printf '%s\n' "${results[@]}"
    exit "$failed"
}

prepare_work_folder() {
    work=$(mktemp -d)
    if [[ -n ${CI_KEEP:-} ]]; then
        log "working in $work, which is kept"
    else
        trap 'rm -rf "$work"' EXIT
    fi
    mkdir -p "$work/source"
    copy_checkout "$work/source"
}

# Copy the files that git tracks, or would: neither build products nor what is ignored.
copy_checkout() {
    local target=$1
    cd "$checkout"
    if command -v git >/dev/null && [[ -e .git ]]; then
        git ls-files --cached --others --exclude-standard -z |
            while IFS= read -r -d '' file; do
                [[ ! -f $file ]] || printf '%s\0' "$file"
            done | tar --null --files-from=- -cf - | tar -xf - -C "$target"
    else
        tar --exclude=.git --exclude='.venv*' -cf - . | tar -xf - -C "$target"
    fi
    cd - >/dev/null
}

describe_machine() {
    log "$(uname -srm), $(nproc) cores, $("$python" --version)"
    log "volumes that are not shipped: ${PYVISTA_VDI_DATA:-none (PYVISTA_VDI_DATA is not set)}"
}

# Install what a bare Debian lacks: a second OpenCL implementation, off-screen OpenGL, git, and the
# packages given as arguments, of which a browser is one.
install_system_packages() {
    if ! command -v dpkg-query >/dev/null || ! command -v apt-get >/dev/null; then
        log "not a Debian: taking the system as it is"
        return 0
    fi
    local package missing=()
    for package in pocl-opencl-icd libegl1 libgl1-mesa-dri xvfb libgl1 "$@"; do
        dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q 'ok installed' ||
            missing+=("$package")
    done
    command -v git >/dev/null || missing+=(git)
    "$python" -c 'import ensurepip' 2>/dev/null || missing+=(python3-venv)
    if ((${#missing[@]} == 0)); then
        log "every system package is there"
        return 0
    fi
    local as_root=()
    ((EUID == 0)) || as_root=(sudo -n)
    log "installing ${missing[*]}"
    export DEBIAN_FRONTEND=noninteractive
    "${as_root[@]}" apt-get update -qq
    "${as_root[@]}" apt-get install -y -qq --no-install-recommends "${missing[@]}"
}

# The wheel is built once; every environment installs that file.
build_wheel() {
    compgen -G "$work/dist/*.whl" >/dev/null ||
        "$1" -m pip wheel --quiet --no-deps --wheel-dir "$work/dist" "$work/source"
}

# create_environment FOLDER PYTHON EXTRAS [more arguments of pip install]
create_environment() {
    local folder=$1 interpreter=$2 extras=$3
    shift 3
    "$interpreter" -m venv "$folder"
    "$folder/bin/python" -m pip --version
    build_wheel "$folder/bin/python"
    install "$folder" "$extras" "$@"
}

# install FOLDER EXTRAS [more arguments of pip]
install() {
    local folder=$1 extras=$2 wheel
    shift 2
    wheel=$(compgen -G "$work/dist/*.whl")
    "$folder/bin/python" -m pip install --quiet "pyvista-vdi$extras @ file://$wheel" "$@"
}

# The tests must see the installed package: they are copied away from it, with what they read. Once:
# steps beside each other read them.
copy_tests() {
    [[ ! -d $work/tests-only ]] || return 0
    mkdir -p "$work/tests-only"
    cp -r "$work/source/"{tests,examples,docs,benchmarks,pyproject.toml} "$work/tests-only/"
}

check_installed_copy() {
    copy_tests
    cd "$work/tests-only"
    "$work/venv/bin/python" - <<'PYTHON'
import importlib.resources
import sysconfig
from pathlib import Path

import pyvista_vdi

place = Path(pyvista_vdi.__file__).resolve()
site_packages = Path(sysconfig.get_path("purelib")).resolve()
assert place.is_relative_to(site_packages), f"{place} is not inside {site_packages}"
kernels = list(Path(str(importlib.resources.files("pyvista_vdi.opencl"))).rglob("*.cl"))
assert kernels, "the installed package has no kernels"
print(f"{place.parent}, version {pyvista_vdi.__version__}, {len(kernels)} kernel files")
PYTHON
}

check_opencl_implementations() {
    cd "$work" # not the checkout, which Python would import from
    "$work/venv/bin/pyvista-vdi" devices
    PYVISTA_VDI_MIN_PLATFORMS=${PYVISTA_VDI_MIN_PLATFORMS:-2} "$work/venv/bin/python" - <<'PYTHON'
import os

from pyvista_vdi.device import list_devices

wanted = int(os.environ["PYVISTA_VDI_MIN_PLATFORMS"])
platforms = sorted({device.platform for device in list_devices() if device.usable})
print(f"usable OpenCL implementations: {', '.join(platforms) or 'none'}")
if len(platforms) < wanted:
    raise SystemExit(
        f"{len(platforms)} usable OpenCL implementations, {wanted} wanted: install another one, "
        "or set PYVISTA_VDI_MIN_PLATFORMS"
    )
PYTHON
}

# run_tests [more arguments of pytest]: by as many processes as pyproject.toml says, on the devices
# that PYVISTA_VDI_TEST_DEVICES names
run_tests() {
    copy_tests
    cd "$work/tests-only"
    local result=0
    "$work/venv/bin/python" -m pytest -p no:cacheprovider "$@" || result=$?
    # 5: no test was selected, which is fine for a marker that no test carries yet
    ((result == 0 || (result == 5 && $# > 0)))
}

# run_tests_on_second_implementation MARKERS [folders]: those tests that use a device, on the
# implementation that the README's test command does not use.
run_tests_on_second_implementation() {
    local markers=$1
    shift
    export PYVISTA_VDI_TEST_DEVICES=${PYVISTA_VDI_SECOND_IMPLEMENTATION:-portable computing language}
    run_tests -m "$markers" "$@"
}

# Of those the fast ones of the rooms that are about kernels.
run_kernel_tests_on_second_implementation() {
    run_tests_on_second_implementation "device and fast" \
        tests/{device,model,volume,generation,raycasting,extremes}
}

# Those that are slow, on every implementation.
run_slow_tests() {
    export PYVISTA_VDI_TEST_DEVICES=all
    # A file of forty minutes is shared, too: not by files
    run_tests -m "slow and not paraview" --dist worksteal
}

# Each target guided by coverage, where atheris has a wheel for this Python.
run_fuzzing() {
    if ! install "$work/venv" "[fuzz]" --only-binary atheris; then
        log "atheris cannot be installed here: nothing is fuzzed beyond the tests"
        return 0
    fi
    copy_tests
    cd "$work/tests-only"
    "$work/venv/bin/python" tests/fuzz/run.py --seconds "${CI_FUZZ_SECONDS:-30}"
}

# The plugin in a real ParaView; tools/ installs one where there is none.
run_paraview_tests() {
    # PYTHON is the tests' interpreter, ParaView has its own
    env -u PYTHON EXTRAS=cpu,mpi bash "$work/source/tools/install_paraview.sh" \
        "$work/paraview" "$(compgen -G "$work/dist/*.whl")"
    export PYVISTA_VDI_PARAVIEW=$work/paraview PYVISTA_VDI_REQUIRE_PARAVIEW=1
    run_tests -m paraview -n 0 # one ParaView at a time
}

check_lint() {
    cd "$work/source"
    "$work/venv/bin/ruff" check --no-cache .
    "$work/venv/bin/ruff" format --no-cache --check .
}

check_types() {
    cd "$work/source"
    "$work/venv/bin/mypy" --cache-dir="$work/mypy-cache"
}

build_docs() {
    cd "$work" # not a checkout, whose package Python would find before the installed one
    "$work/venv/bin/python" -m sphinx -W --keep-going -q -b html \
        "$work/source/docs" "$work/docs-html"
    log "built $(find "$work/docs-html" -name '*.html' | wc -l) pages without a warning"
    # The VDIs on them turn in a browser
    copy_tests
    cd "$work/tests-only"
    PYVISTA_VDI_SITE="$work/docs-html" "$work/venv/bin/python" -m pytest -p no:cacheprovider -q -n 0 \
        -m "slow or not slow" tests/web/test_live_docs.py
}

# Python in the pages and in docstrings runs against the installed package.
run_documented_code() {
    mkdir -p "$work/documented"
    cp -r "$work/source/docs" "$work/source/pyproject.toml" "$work/documented/"
    cp "$work/source/README.md" "$work/documented/docs/readme.md"
    cd "$work/documented"
    "$work/venv/bin/python" -m pytest -p no:cacheprovider -q docs
    # ParaView's plugin can be imported only in ParaView
    "$work/venv/bin/python" -m pytest -p no:cacheprovider -q --doctest-modules \
        --ignore-glob='/*/pyvista_vdi/paraview/*' --pyargs pyvista_vdi
}

# The README's first command, to the letter, in a clone of its own.
run_main_command() {
    run_readme_command "main command"
    [[ -n $(find out -type f -size +0) ]] || {
        log "the README's first command wrote nothing into out/"
        return 1
    }
    ls -l out
}

# And its second, in full: tests that find the installed package elsewhere may not in a checkout.
run_test_command() {
    run_readme_command "test command"
}

# run_readme_command NAME: in a new clone, where it stays.
run_readme_command() {
    local clone="$work/${1// /-}" command
    mkdir -p "$clone"
    cp -r "$work/source/." "$clone"
    cd "$clone"
    command=$(readme_command "$1")
    log "$command"
    bash -euo pipefail -c "$command"
}

# Print the fenced block that follows the line  <!-- NAME -->  in README.md.
readme_command() {
    awk -v mark="<!-- $1 -->" '
        $0 == mark { wanted = 1; next }
        wanted && /^```/ { if (inside) exit; inside = 1; next }
        inside { print; found = 1 }
        END { if (!found) exit 1 }
    ' "$work/source/README.md" || {
        log "README.md has no fenced block after <!-- $1 -->" >&2
        return 1
    }
}

create_test_environment() {
    create_environment "$work/venv" "$python" "[test,dev]"
}

# The oldest interpreter with, of every dependency, the oldest version that pyproject.toml allows.
create_oldest_environment() {
    local oldest=${PYTHON_OLDEST:-python3.10}
    if ! "$oldest" -c '' 2>/dev/null; then
        log "$oldest is not installed: testing the oldest versions with $("$python" --version)"
        oldest=$python
    fi
    "$work/venv/bin/python" "$work/source/.ci/lower_bounds.py" "$work/source/pyproject.toml" \
        >"$work/constraints.txt"
    # The oldest matplotlib calls what newer ones have deprecated, and a test has warnings as errors
    echo "pyparsing<3.3" >>"$work/constraints.txt"
    cat "$work/constraints.txt"
    create_environment "$work/oldest" "$oldest" "[test]" --constraint "$work/constraints.txt"
}

run_oldest_tests() {
    copy_tests
    cd "$work/tests-only"
    # Old releases warn about what newer ones of their own dependencies deprecate: warnings are
    # errors only with the current versions.
    "$work/oldest/bin/python" -m pytest -p no:cacheprovider -W default
}
