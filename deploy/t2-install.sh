#!/bin/sh
# Installs T2 on a computer without internet, from the folder that `make wheelhouse` made:
#
#   sudo sh t2-install.sh [--sim]      install this version, or upgrade to it
#   sudo sh t2-install.sh --rollback   go back to the version before
#
# Versions live side by side in /opt/t2 (another folder: T2_HOME=DIR); `current` links to the one
# in use, `previous` to the one before. Nothing is started: `t2 install` says what to do next.
# T2_ROOT=DIR writes the units under DIR, to look at them first.
set -eu

HOME_OF_T2=${T2_HOME:-/opt/t2}
ROOT=${T2_ROOT:-/}
HOUSE=$(cd "$(dirname "$0")" && pwd)
PYTHON=${PYTHON:-python3}
WANTED_MB=400

say() { echo "t2-install: $*"; }
fail() {
    say "$*" >&2
    exit 1
}

check() {
    [ -d "$HOME_OF_T2" ] || mkdir -p "$HOME_OF_T2" 2>/dev/null || true
    [ -w "$HOME_OF_T2" ] || fail "cannot write to $HOME_OF_T2: say sudo sh $0"
    if [ "$ROOT" = / ] && [ "$(id -u)" != 0 ]; then fail "wants root: say sudo sh $0"; fi
}

check_house() {
    cd "$HOUSE"
    for file in requirements.txt VERSION PLATFORM SHA256SUMS; do
        [ -f $file ] || fail "$HOUSE is no wheelhouse, $file is missing: copy all of build/wheelhouse"
    done
    sha256sum --quiet -c SHA256SUMS || fail "$HOUSE is damaged: copy it again"
    "$PYTHON" -c 'import sys, venv; sys.exit(sys.version_info < (3, 11))' ||
        fail "wants Python 3.11 or newer with venv as $PYTHON: say PYTHON=/path/to/python3.11 sh $0"
    free_mb=$(df -Pm "$HOME_OF_T2" | awk 'NR == 2 { print $4 }')
    [ "$free_mb" -ge $WANTED_MB ] || fail "$HOME_OF_T2 has $free_mb MB left, $WANTED_MB are wanted"
}

# An environment is made once, under the name of its version and contents, and never changed.
build() {
    if [ -f "$1/.complete" ]; then
        say "$1 is there already"
        return
    fi
    say "making $1"
    rm -rf "$1"
    "$PYTHON" -m venv --without-pip "$1"
    "$1/bin/python" "$(echo "$HOUSE"/pip-*.whl)/pip" --isolated --quiet install --no-index \
        --find-links "$HOUSE" --require-hashes --only-binary :all: -r "$HOUSE/requirements.txt" ||
        fail "nothing was changed; this wheelhouse is for $(cat "$HOUSE/PLATFORM")"
    touch "$1/.complete"
}

# A link is replaced in one step: there is always a current version.
point() {
    ln -sfn "$2" "$HOME_OF_T2/.$1"
    mv -T "$HOME_OF_T2/.$1" "$HOME_OF_T2/$1"
}

use() {
    wanted=$1
    shift
    before=$(readlink "$HOME_OF_T2/current" || true)
    if ! "$HOME_OF_T2/$wanted/bin/python" -P -m cli install --dry-run --root "$ROOT" \
        --prefix "$HOME_OF_T2/current" "$@" >/dev/null; then
        fail "$wanted would not run with these settings; nothing was changed"
    fi
    if [ "$before" != "$wanted" ]; then
        [ -z "$before" ] || point previous "$before"
        point current "$wanted"
    fi
    say "current is $wanted${before:+, before it was $before}"
    "$HOME_OF_T2/current/bin/python" -P -m cli install --root "$ROOT" \
        --prefix "$HOME_OF_T2/current" "$@"
}

# What is not understood must not install: it may have been meant to go back.
case "$*" in
'' | --sim | --rollback) ;;
*) fail "does not know '$*', nothing was changed: say sudo sh $0 [--sim | --rollback]" ;;
esac
check
if [ "${1:-}" = --rollback ]; then
    previous=$(readlink "$HOME_OF_T2/previous") || fail "there is no version before"
    use "$previous"
else
    check_house
    version=$(cat "$HOUSE/VERSION")-$(sha256sum "$HOUSE/requirements.txt" | cut -c 1-8)
    build "$HOME_OF_T2/$version"
    use "$version" "$@"
fi
