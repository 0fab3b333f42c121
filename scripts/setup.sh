#!/bin/sh
# Make .venv: a Python of its own with every member of the workspace (editable), in the versions of constraints.txt; or
# add the tools of one dependency group to it. Called by the Makefile; needs Python 3.11 or newer and touches nothing
# outside this folder.
#   usage: scripts/setup.sh MEMBER...        PYTHON=/path/to/python chooses the interpreter
#          scripts/setup.sh --group GROUP    GROUP is test, check or site
set -eu

say() { printf '%s\n' "setup: $*"; }
fail() { printf '%s\n' "setup: $*" >&2; exit 1; }

find_python() {
    for candidate in ${PYTHON:-python3 python3.13 python3.12 python3.11 python}; do
        if "$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
            "$candidate" -c 'import sys; print(sys.executable)'
            return
        fi
    done
    fail "needs Python 3.11 or newer; looked for: ${PYTHON:-python3 python3.13 python3.12 python3.11 python}." \
        "Install one (Debian, Ubuntu: apt-get install python3.11 python3.11-venv) or name it: make venv PYTHON=/path/to/python"
}

# uv from the PATH, else from .venv-tools, else fetched into .venv-tools with the pip of a virtual environment, else
# (Debian's python3 without python3-venv) with the system's pip, which then only writes into that folder.
find_uv() {
    if uv pip install --help 2>/dev/null | grep -q -e --group; then  # older ones cannot install groups
        echo uv
        return
    fi
    if ! .venv-tools/bin/uv --version >/dev/null 2>&1; then
        say "fetching uv, the installer, into .venv-tools" >&2
        rm -rf .venv-tools
        if "$python" -m venv .venv-tools >/dev/null 2>&1; then
            .venv-tools/bin/python -m pip install --quiet --disable-pip-version-check uv >&2
        elif rm -rf .venv-tools && "$python" -m pip --version >/dev/null 2>&1; then
            "$python" -m pip install --quiet --disable-pip-version-check --root-user-action=ignore --target .venv-tools uv >&2
        else
            version=$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
            fail "$python has neither pip nor a working venv module, so uv cannot be fetched." \
                "Debian, Ubuntu: apt-get install python$version-venv; or install uv yourself and put it on the PATH"
        fi
        .venv-tools/bin/uv --version >/dev/null || fail "uv was fetched into .venv-tools but does not run there"
    fi
    echo .venv-tools/bin/uv
}

# Install what the arguments say. A terminal gets the installer's progress bars; a pipe its lines, without the list of
# every package. Byte code is compiled here and not by the first process: without it a process takes twice as long to
# start, and where PYTHONDONTWRITEBYTECODE is set or .venv is read-only it would be missing for good.
install() {
    set -- "$uv" pip install --python .venv/bin/python --constraint constraints.txt --compile-bytecode "$@"
    if [ -t 2 ]; then
        "$@"
    else
        status=$({ { "$@" 2>&1 && echo 0 >&3 || echo $? >&3; } | sed '/^ [-+~] /d; /^ *Buil[dt]/d; s/^/  /' >&2; } 3>&1)
        return "$status"
    fi
}

size() { du -sh .venv | cut -f 1; }

[ $# -gt 0 ] || fail "usage: scripts/setup.sh MEMBER... or scripts/setup.sh --group GROUP"
started=$(date +%s)
python=$(find_python)
uv=$(find_uv)

if [ "$1" = --group ]; then
    say "adding the tools of 'make $2' to .venv"
    install --group "$2"
    say "done after $(($(date +%s) - started)) s; .venv takes $(size)"
    exit
fi

if ! .venv/bin/python -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
    say "making .venv with $python"
    rm -rf .venv
    "$uv" venv --quiet --python "$python" .venv
fi

editable=""
for member in "$@"; do
    case $member in
        core) editable="$editable --editable ./core[all]" ;;  # with everything optional that is ours
        *) editable="$editable --editable ./$member" ;;
    esac
done
say "installing anysim and the engines into .venv (some minutes where packages must be downloaded, else seconds)"
# shellcheck disable=SC2086  # the options are words
install $editable
say "compiling the sources of $*"
.venv/bin/python -m compileall -q "$@"
say "done after $(($(date +%s) - started)) s: $(.venv/bin/python --version) in .venv, which takes $(size)"
