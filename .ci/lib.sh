# What .ci/run and .ci/nightly share: a bare Debian becomes a machine that can test the wheel.
# Sourced with $checkout set. What is checked, and how, is in noxfile.py.
# shellcheck shell=bash

python=${PYTHON:-python3}
export CI=${CI:-true}
export PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_NO_INPUT=1 PIP_ROOT_USER_ACTION=ignore
export PIP_COMPILE=0 # Python compiles what is imported: a fraction of what is installed
export PYTHONDONTWRITEBYTECODE=1
# Off-screen rendering without a display; VTK chooses its window by this
export VTK_DEFAULT_OPENGL_WINDOW=${VTK_DEFAULT_OPENGL_WINDOW:-vtkEGLRenderWindow}
export PYVISTA_OFF_SCREEN=true
# A machine without an OpenCL device, or a browser, fails the tests that need one
export PYVISTA_VDI_REQUIRE_DEVICE=1 PYVISTA_VDI_REQUIRE_BROWSER=1
# The tests refuse to run on the sources, and compare the distributions with the checkout's files
export PYVISTA_VDI_REQUIRE_INSTALLED=1 PYVISTA_VDI_CHECKOUT=$checkout
# git reads a checkout that somebody else owns, as in a container
export GIT_CONFIG_COUNT=1 GIT_CONFIG_KEY_0=safe.directory GIT_CONFIG_VALUE_0='*'
if [[ -z ${PYVISTA_VDI_DATA:-} && -d $checkout/../shared/data ]]; then
    PYVISTA_VDI_DATA=$(cd "$checkout/../shared/data" && pwd)
    export PYVISTA_VDI_DATA
fi

results=()
failed=0
status=0 # of the last step
processors=0 # seconds of it

log() { printf '%s\n' "-- $*"; }

# step NAME COMMAND...: run it in a shell of its own, where its first failing command ends it.
# Not to be called in a condition: there bash ignores that a command fails.
step() {
    local name=$1 start=$SECONDS
    shift
    printf '\n==== %s\n' "$name"
    set +e
    (
        (set -euo pipefail && "$@")
        status=$?
        times >"$work/times"
        exit "$status"
    ) </dev/null
    status=$?
    set -e
    report "$name" "$status" $((SECONDS - start)) "$work/times"
}

# report NAME STATUS SECONDS TIMES: the last is a file with what `times` printed. Steps that run beside
# each other take longer by the others, but no more of the processors.
report() {
    local word=passed
    processors=$(awk 'NR == 2 { gsub(/[ms]/, " "); print int($1 * 60 + $2 + $3 * 60 + $4) }' "$4")
    (($2 == 0)) || word=FAILED failed=1
    results+=("$(printf '%s  %-22s %5d s, %5d s of processors' "$word" "$1" "$3" "$processors")")
    printf '==== %s\n' "${results[-1]}"
}

# A step without which the following ones make no sense.
required() {
    step "$@"
    ((status == 0)) || summarise
}

# beside NAME COMMAND...: begin a step that goes on while others run; what it prints is shown by
# `finish`, which waits for all of them.
beside() {
    local name=$1
    shift
    (
        start=$SECONDS
        set +e
        (set -euo pipefail && "$@") </dev/null >"$work/$name.log" 2>&1
        status=$?
        times >"$work/$name.times"
        printf '%d %d' "$status" $((SECONDS - start)) >"$work/$name.status"
    ) &
    begun+=("$name")
}

begun=()
finish() {
    local name seconds
    wait
    for name in ${begun[@]+"${begun[@]}"}; do
        read -r status seconds <"$work/$name.status" || true
        printf '\n==== %s\n' "$name"
        # The cause of a failure stands at the end, where a long log would bury it
        if ((status == 0)); then tail -n 15 "$work/$name.log"; else tail -n 300 "$work/$name.log"; fi
        report "$name" "$status" "$seconds" "$work/$name.times"
    done
    begun=()
}

summarise() {
    printf '\n==== summary, %d s in all\n' "$SECONDS"
    printf '%s\n' "${results[@]}"
    exit "$failed"
}

# Copy the files that git tracks, or would, into a folder of our own: the checkout stays as it is.
prepare() {
    work=$(mktemp -d)
    if [[ -n ${CI_KEEP:-} ]]; then log "working in $work, which is kept"; else trap 'rm -rf "$work"' EXIT; fi
    mkdir -p "$work/source"
    (cd "$checkout" && git ls-files --cached --others --exclude-standard -z |
        while IFS= read -r -d '' file; do [[ ! -f $file ]] || printf '%s\0' "$file"; done |
        tar --null --files-from=- -cf - | tar -xf - -C "$work/source")
    # The tests must see the installed package: they lie away from the sources, with what they read
    mkdir "$work/tests-only"
    cp -r "$work/source/"{tests,examples,docs,benchmarks,pyproject.toml} "$work/tests-only/"
    log "$(uname -srm), $(nproc) cores, $("$python" --version)"
    log "volumes that are not shipped: ${PYVISTA_VDI_DATA:-none (PYVISTA_VDI_DATA is not set)}"
}

# Packages beyond those that README names
beyond_readme=(pocl-opencl-icd xvfb libgl1 openmpi-bin)

# install_packages PACKAGE...: what README has a bare Debian install, and these.
install_packages() {
    if ! command -v apt-get >/dev/null; then
        log "not a Debian: taking the system as it is"
        return 0
    fi
    local package missing=() as_root=()
    for package in git libegl1 libgl1-mesa-dri "$@"; do
        dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q 'ok installed' ||
            missing+=("$package")
    done
    "$python" -c 'import ensurepip' 2>/dev/null || missing+=(python3-venv)
    ((${#missing[@]})) || return 0
    ((EUID == 0)) || as_root=(sudo -n)
    log "installing ${missing[*]}"
    export DEBIAN_FRONTEND=noninteractive
    "${as_root[@]}" apt-get update -qq
    "${as_root[@]}" apt-get install -y -qq --no-install-recommends "${missing[@]}"
}

# environment FOLDER PYTHON EXTRAS [arguments of pip]: one with the wheel, which is built once.
environment() {
    local folder=$1 interpreter=$2 extras=$3
    shift 3
    "$interpreter" -m venv "$folder"
    compgen -G "$work/dist/*.whl" >/dev/null ||
        "$folder/bin/pip" wheel --quiet --no-deps --wheel-dir "$work/dist" "$work/source"
    "$folder/bin/pip" install --quiet \
        "pyvista-vdi$extras @ file://$(compgen -G "$work/dist/*.whl")" "$@"
}

# The tests must see the installed package, and two OpenCL implementations.
check_environment() {
    cd "$work/tests-only"
    "$work/venv/bin/pyvista-vdi" devices
    PYVISTA_VDI_MIN_PLATFORMS=${PYVISTA_VDI_MIN_PLATFORMS:-2} "$work/venv/bin/python" - <<'PYTHON'
import importlib.resources
import os
import sysconfig
from pathlib import Path

import pyvista_vdi
from pyvista_vdi.device import list_devices

place = Path(pyvista_vdi.__file__).resolve()
assert place.is_relative_to(Path(sysconfig.get_path("purelib")).resolve()), place
kernels = list(Path(str(importlib.resources.files("pyvista_vdi.opencl"))).rglob("*.cl"))
assert kernels, "the installed package has no kernels"
print(f"{place.parent}, version {pyvista_vdi.__version__}, {len(kernels)} kernel files")

wanted = int(os.environ["PYVISTA_VDI_MIN_PLATFORMS"])
platforms = sorted({device.platform for device in list_devices() if device.usable})
print(f"usable OpenCL implementations: {', '.join(platforms) or 'none'}")
wrong = f"{wanted} are wanted: install another one, or set PYVISTA_VDI_MIN_PLATFORMS"
assert len(platforms) >= wanted, wrong
PYTHON
}

# tests_of ENVIRONMENT [arguments of pytest]
tests_of() {
    local env=$1
    shift
    cd "$work/tests-only"
    "$env/bin/python" -m pytest -p no:cacheprovider "$@"
}

# tests_on_second_implementation [arguments of pytest]: by the one that users do not get first
tests_on_second_implementation() {
    export PYVISTA_VDI_TEST_DEVICES=${PYVISTA_VDI_SECOND_IMPLEMENTATION:-portable computing language}
    tests_of "$work/venv" "$@"
}

# tests_with_cvista [arguments of pytest]: with the build of VTK that PyVista takes once it is there
tests_with_cvista() {
    if ! "$work/venv/bin/python" -c 'import sys; sys.exit(sys.version_info < (3, 11))'; then
        log "cvista is for Python 3.11 and newer: nothing is tested with it"
        return 0
    fi
    "$work/venv/bin/pip" install --quiet --target "$work/cvista" "cvista[all]<9.8"
    export PYTHONPATH=$work/cvista
    [[ $("$work/venv/bin/python" -c 'import pyvista; print(pyvista.vtk_backend())') == cvista ]]
    "$work/venv/bin/pyvista-vdi" compare --example brain --size 320x180 --out "$work/cvista-out"
    tests_of "$work/venv" "$@"
}

# checks SESSION...: those of noxfile.py, in the environment with the wheel
checks() {
    export PATH="$work/venv/bin:$PATH" PYVISTA_VDI_SITE="$work/docs-html"
    cd "$work/source"
    nox --no-venv --no-install -s "$@"
}

# paraview_tests [arguments of pytest]: in a real ParaView; tools/ installs one where there is none
paraview_tests() {
    # PYTHON is the tests' interpreter, ParaView has its own
    env -u PYTHON EXTRAS=cpu,mpi bash "$work/source/tools/install_paraview.sh" \
        "$work/paraview" "$(compgen -G "$work/dist/*.whl")"
    export PYVISTA_VDI_PARAVIEW=$work/paraview PYVISTA_VDI_REQUIRE_PARAVIEW=1
    tests_of "$work/venv" -m paraview -n 0 "$@" tests/extensions/paraview # one at a time
}

# readme_command NAME: to the letter, in a copy of its own, the block after  <!-- NAME command -->
readme_command() {
    local command copy="$work/readme-$1"
    command=$(awk -v mark="<!-- $1 command -->" '
        $0 == mark { wanted = 1; next }
        wanted && /^```/ { if (inside) exit; inside = 1; next }
        inside { print; found = 1 }
        END { if (!found) exit 1 }' "$work/source/README.md") || {
        log "README.md has no fenced block after <!-- $1 command -->"
        return 1
    }
    mkdir -p "$copy"
    cp -r "$work/source/." "$copy"
    cd "$copy"
    log "$command"
    bash -euo pipefail -c "$command"
    if [[ $1 == main ]]; then
        .venv/bin/pyvista-vdi devices
        [[ -n $(find out -type f -size +0) ]]
    fi
}

# OpenCL drivers, programs and a library that are seen here, and that README's machine does not have
not_of_readme() {
    local file
    for file in /etc/OpenCL/vendors/*.icd /usr/lib/*/libOpenEXRUtil*.so.* $(type -aP mpirun mpiexec \
        node npm Xvfb exrinfo oiiotool pvpython clang google-chrome firefox{,-esr} \
        chromium{,-browser,-headless-shell}); do
        [[ ! -f $file || ($file == */bin/* && ! -x $file) ]] || readlink -f "$file"
    done | sort -u
}

# as_readme COMMAND...: run it where those are hidden, and nothing is set that README does not set.
as_readme() {
    local hidden namespace=()
    mapfile -t hidden < <(not_of_readme)
    if ((${#hidden[@]})); then
        namespace=(unshare --mount)
        ((EUID == 0)) || namespace+=(--map-root-user)
        "${namespace[@]}" true || {
            log "README's commands are to run without ${hidden[*]}, and 'unshare --mount' cannot hide" \
                "them here: take a machine without them, or let root make namespaces (CAP_SYS_ADMIN)"
            return 1
        }
    fi
    unset "${!PYVISTA@}" VTK_DEFAULT_OPENGL_WINDOW
    export work
    export -f log not_of_readme readme_command
    "${namespace[@]}" bash -euo pipefail -c '
        while [[ $1 != -- ]]; do mount --bind /dev/null "$1"; shift; done
        shift
        seen=$(not_of_readme)
        log "drivers and programs that are not of README: ${seen:-none}"
        [[ -z $seen ]]
        "$@"' bash "${hidden[@]}" -- "$@"
}

# README's test command, and a list of what it skips: a test, " - Skipped: " and the reason in a line
readme_tests() {
    PYTEST_ADDOPTS=--no-fold-skipped as_readme readme_command test | tee "$work/readme-test.log"
}

# Compare why tests were skipped with .ci/skipped; CI_ACCEPT_SKIPPED writes that.
compare_skipped() {
    sed -n 's/^SKIPPED //p' "$work/readme-test.log" >"$work/skipped"
    sed 's/.* - Skipped: //' "$work/skipped" | sort -u >"$work/reasons"
    [[ -z ${CI_ACCEPT_SKIPPED:-} ]] || cp "$work/reasons" "$checkout/.ci/skipped"
    diff "$checkout/.ci/skipped" "$work/reasons"
}

# Those tests, by what README's machine does not have
skipped_tests() {
    sed 's/ - Skipped: .*//' "$work/skipped" >"$work/skipped-tests"
    tests_of "$work/venv" "@$work/skipped-tests"
}
