#!/bin/sh
# Finds what pip cannot bring and gets it where that is allowed: as root on Debian and Ubuntu by apt-get.
# Elsewhere it says in one line what to type; it never calls sudo.
#
#   tools/system_packages.sh PYTHON [venv] [gl] [browser] [node] [nginx]
#
# nginx is unpacked into build/nginx for its test and not installed: a package of Debian starts a server at port 80.
# Exit 1 if PYTHON cannot serve. A missing renderer or browser stops nothing here: the tests that need
# one skip with a reason, or fail where CI=true.
set -eu

python=$1
shift
wanted=$*
unpacked=build/nginx
renderer="libegl1 libgl1 libgl1-mesa-dri libosmesa6"

stop() {
    echo "$1" >&2
    exit 1
}

loads() {
    "$python" -c 'import ctypes, sys; [ctypes.CDLL(name) for name in sys.argv[1:]]' "$@" 2>/dev/null
}

has() {
    case $1 in
    venv) command -v uv >/dev/null || "$python" -c 'import ensurepip, venv' 2>/dev/null ;;
    gl) loads libOSMesa.so.8 || loads libEGL.so.1 libGL.so.1 ;;
    browser)
        [ -n "${FACEAMBIG_CHROMIUM:-}" ] || command -v chromium || command -v chromium-browser ||
            command -v google-chrome || ls -d "$HOME"/.cache/ms-playwright/chromium-*
        ;;
    nginx) PATH="$PATH:/usr/sbin:/usr/local/sbin:$unpacked/usr/sbin" command -v nginx ;;
    node) loads libatomic.so.1 ;; # playwright brings its own Node, which needs this one library
    esac >/dev/null 2>&1
}

# Needs no root. The program is in another package on each system; a missing one only skips a test.
fetch_nginx() {
    command -v apt-get >/dev/null && command -v dpkg-deb >/dev/null || return 0
    mkdir -p "$unpacked"
    # A container has no lists of packages
    [ "$(id -u)" != 0 ] || apt-get -qq -o DPkg::Lock::Timeout=120 update >/dev/null 2>&1 || true
    for package in nginx nginx-core; do
        (
            cd "$unpacked" && apt-get -qq download "$package" && dpkg-deb -x "$package"_*.deb .
        ) </dev/null >/dev/null 2>&1 || true
        [ ! -x "$unpacked/usr/sbin/nginx" ] || break
    done
    "$unpacked/usr/sbin/nginx" -v >/dev/null 2>&1 || rm -rf "$unpacked"
}

# What is missing, in $names; its packages, in $packages; a browser that apt cannot give, in $by_playwright.
find_missing() {
    names= packages= by_playwright=
    for need in $wanted; do
        has "$need" && continue
        case $need in
        venv) packages="$packages python3-venv" ;;
        gl)
            names="$names, software renderer (pictures)"
            packages="$packages $renderer"
            ;;
        browser)
            # Ubuntu has Chromium as a snap only, which cannot be steered from outside.
            if [ "$system" = ubuntu ]; then
                by_playwright=yes
            else
                names="$names, Chromium (page tests)"
                packages="$packages chromium"
            fi
            ;;
        nginx) fetch_nginx ;;
        node)
            names="$names, libatomic (page tests)"
            packages="$packages libatomic1"
            ;;
        esac
    done
    packages=${packages# }
}

if command -v "$python" >/dev/null; then
    "$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null ||
        stop "faceambig needs Python 3.11 or newer, '$python' is not: make PY=/path/to/python3.11 ..."
elif [ "$python" != python3 ]; then
    stop "'$python' is not found: make PY=/path/to/python3.11 ..."
fi

system=$(. /etc/os-release 2>/dev/null && echo "${ID:-}") || system=
find_missing

if [ -n "$packages" ] && [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
    export DEBIAN_FRONTEND=noninteractive
    apt="apt-get -qq -o DPkg::Lock::Timeout=120"
    echo "apt-get install $packages"
    $apt update || true
    known=
    for package in $packages; do
        # Newer systems have no libosmesa6: EGL alone serves there.
        apt-cache show "$package" >/dev/null 2>&1 && known="$known $package"
    done
    # shellcheck disable=SC2086 # one word a package
    $apt install -y --no-install-recommends $known </dev/null >/dev/null || true
    find_missing
fi

if [ -n "$packages" ]; then
    line="to type: sudo apt-get install -y $packages"
    case " $packages " in
    *" python3-venv "*) stop "$python cannot make a virtual environment; $line" ;;
    *) echo "not found:${names#,}; $line" >&2 ;;
    esac
fi
if [ -n "$by_playwright" ]; then
    echo "not found: Chromium (page tests); to type: .venv/bin/playwright install --with-deps chromium" >&2
fi
