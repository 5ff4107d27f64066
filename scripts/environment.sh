# Sourced by the other scripts: goes to the repository's root and makes .venv ready.
# Needs nothing but Python 3.10 or later on PATH.

unset CDPATH
cd "$(dirname "${BASH_SOURCE[0]}")/.."

works() { # PYTHON: tell whether it runs, is new enough and can make environments
    "$1" -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 10))' >/dev/null 2>&1
}

find_python() {
    local name seen=""
    for name in python3.13 python3.12 python3.11 python3.10 python3 python; do
        if works "$name"; then
            echo "$name"
            return
        fi
        seen+="$("$name" -V 2>/dev/null | sed "s/^/$name is /;s/\$/; /" || true)"
    done
    seen="${seen%; }"
    echo "adv2e needs Python 3.10 or later with venv and pip (on Debian and Ubuntu: apt install" \
        "python3-venv); found: ${seen:-no Python at all}" >&2
    return 1
}

# install_adv2e EXTRAS: install the package, in place, with EXTRAS ("", "[docs]" or "[test]", which
# holds all others), unless that is done already for this pyproject.toml, interpreter and place
install_adv2e() {
    local base stamp wanted
    if ! works .venv/bin/python; then
        base="$(find_python)"
        echo "Making .venv with $("$base" -V)"
        "$base" -m venv --clear .venv
    fi
    wanted="$(cksum <pyproject.toml) $(.venv/bin/python -VV | tr '\n' ' ') $PWD"
    for stamp in ".venv/.installed$1" ".venv/.installed[test]"; do
        if [[ -f $stamp && "$(<"$stamp")" == "$wanted" ]]; then
            return
        fi
    done
    echo "Installing adv2e$1 in .venv (only the first time; it takes a minute or two)"
    .venv/bin/python -m pip install --quiet --disable-pip-version-check --editable ".$1"
    echo "$wanted" >".venv/.installed$1"
}
