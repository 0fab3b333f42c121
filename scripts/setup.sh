#!/bin/sh
# Make .venv: a Python of its own with every member of the workspace (editable) and the developers' tools in it, in the
# versions of constraints.txt. Called by `make venv`; needs Python 3.11 or newer and touches nothing outside this folder.
#   usage: scripts/setup.sh MEMBER...        PYTHON=/path/to/python chooses the interpreter
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
    if uv pip install --help 2>/dev/null | grep -q -e --group; then  # older ones cannot install the dev group
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

[ $# -gt 0 ] || fail "usage: scripts/setup.sh MEMBER..."
python=$(find_python)
uv=$(find_uv)

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
say "installing $* and the developers' tools into .venv"
# shellcheck disable=SC2086  # the options are words
"$uv" pip install --quiet --python .venv/bin/python --constraint constraints.txt --group dev $editable
say "done: $(.venv/bin/python --version) in .venv"
