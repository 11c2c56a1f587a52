#!/bin/sh
# Installs T2 on a computer without internet, from the folder that `make wheelhouse` made:
#
#   sudo sh t2-install.sh [--sim]      install this version, or upgrade to it
#   sudo sh t2-install.sh --rollback   go back to the previous version
#
# Versions are installed side by side in /opt/t2 (another folder: T2_HOME=DIR); `current` links to the one
# in use, `previous` to the one before. It starts nothing: `t2 install` prints the next steps.
# T2_ROOT=DIR writes the units under DIR, for inspection.
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
    [ -w "$HOME_OF_T2" ] || fail "cannot write to $HOME_OF_T2: run sudo sh $0"
    if [ "$ROOT" = / ] && [ "$(id -u)" != 0 ]; then fail "needs root: run sudo sh $0"; fi
}

check_house() {
    cd "$HOUSE"
    for file in requirements.txt VERSION PLATFORM SHA256SUMS; do
        [ -f $file ] || fail "$HOUSE is not a wheelhouse, $file is missing: copy all of build/wheelhouse"
    done
    sha256sum --quiet -c SHA256SUMS || fail "$HOUSE is damaged: copy it again"
    "$PYTHON" -c 'import sys, venv; sys.exit(sys.version_info < (3, 11))' ||
        fail "needs Python 3.11 or newer with venv as $PYTHON: run PYTHON=/path/to/python3.11 sh $0"
    free_mb=$(df -Pm "$HOME_OF_T2" | awk 'NR == 2 { print $4 }')
    [ "$free_mb" -ge $WANTED_MB ] || fail "$HOME_OF_T2 has $free_mb MB free, needs $WANTED_MB MB"
}

# An environment is created once, named by version and content, and never changed.
build() {
    if [ -f "$1/.complete" ]; then
        say "$1 exists already"
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

# Replace the link atomically: there is always a current version.
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
        fail "$wanted cannot run with these settings; nothing was changed"
    fi
    if [ "$before" != "$wanted" ]; then
        [ -z "$before" ] || point previous "$before"
        point current "$wanted"
    fi
    say "current is $wanted${before:+, previously $before}"
    "$HOME_OF_T2/current/bin/python" -P -m cli install --root "$ROOT" \
        --prefix "$HOME_OF_T2/current" "$@"
}

# Unknown arguments must not install: the operator may have meant a rollback.
case "$*" in
'' | --sim | --rollback) ;;
*) fail "unknown arguments '$*'; nothing was changed: run sudo sh $0 [--sim | --rollback]" ;;
esac
check
if [ "${1:-}" = --rollback ]; then
    previous=$(readlink "$HOME_OF_T2/previous") || fail "there is no previous version"
    use "$previous"
else
    check_house
    version=$(cat "$HOUSE/VERSION")-$(sha256sum "$HOUSE/requirements.txt" | cut -c 1-8)
    build "$HOME_OF_T2/$version"
    use "$version" "$@"
fi
