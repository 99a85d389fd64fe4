# Sourced by run.sh and test.sh, from the top of the repository: makes .venv from the lock file and
# brings in OpenFOAM where that is allowed. Repeating it costs a few milliseconds.

say() { printf '%s\n' "$*" >&2; }

# Prints how to become root without a question: nothing as root, "sudo -n" where that works.
root_prefix() {
    if [ "$(id -u)" = 0 ]; then echo ""; elif sudo -n true 2>/dev/null; then echo "sudo -n"; else return 1; fi
}

# install_system PACKAGE...: by apt-get, quietly; the log is shown if it fails.
install_system() {
    local prefix log
    command -v apt-get >/dev/null || return 1
    prefix=$(root_prefix) || return 1
    log=$(mktemp)
    # shellcheck disable=SC2086  # the prefix is one or two words on purpose
    if $prefix apt-get update -qq >"$log" 2>&1 &&
        $prefix env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@" >>"$log" 2>&1; then
        rm -f "$log"
    else
        tail -n 5 "$log" >&2
        rm -f "$log"
        return 1
    fi
}

find_python() {
    local candidate
    for candidate in python3.11 python3.12 python3.13 python3; do
        if command -v "$candidate" >/dev/null &&
            "$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
            command -v "$candidate"
            return
        fi
    done
    return 1
}

make_environment() {
    local python wanted
    wanted=$(cat workflows/requirements.lock pyproject.toml | sha256sum | cut -d' ' -f1)
    [ "$(cat .venv/made-from 2>/dev/null)" = "$wanted" ] && return
    python=$(find_python) || { say "Python 3.11 or newer is needed: apt-get install python3"; return 1; }
    if ! "$python" -c 'import venv, ensurepip' 2>/dev/null; then
        say "setting up: python3-venv"
        install_system python3-venv || { say "Install it with: apt-get install python3-venv"; return 1; }
    fi
    say "setting up: .venv with the packages of workflows/requirements.lock (a minute or two)"
    "$python" -m venv --clear .venv
    .venv/bin/python -m pip install -qq --disable-pip-version-check --require-hashes -r workflows/requirements.lock
    .venv/bin/python -m pip install -qq --disable-pip-version-check --no-deps --no-build-isolation --editable .
    echo "$wanted" >.venv/made-from
}

# What docs.sh needs beside that: sphinx and its extensions.
make_documentation_tools() {
    local wanted
    wanted=$(sha256sum <workflows/docs.lock)
    [ "$(cat .venv/docs-made-from 2>/dev/null)" = "$wanted" ] && return
    say "setting up: sphinx, with the packages of workflows/docs.lock"
    .venv/bin/python -m pip install -qq --disable-pip-version-check --require-hashes --no-deps -r workflows/docs.lock
    echo "$wanted" >.venv/docs-made-from
}

bring_openfoam() {
    command -v icoFoam >/dev/null && return
    say "setting up: OpenFOAM by apt-get (a minute or two)"
    install_system openfoam ||
        say "OpenFOAM is not installed; install it with: apt-get install openfoam. Going on with the shipped cavity field."
}

make_environment
bring_openfoam
