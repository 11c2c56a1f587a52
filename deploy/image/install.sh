#!/bin/sh
# install.sh LOCK | t2: install a lock file, or T2 itself, into /opt/venv.
set -eu
source=/opt/src
wheels=$source/build/wheelhouse
if [ ! -d /opt/venv ]; then
  python3 -m venv /opt/pip
  python3 -m venv --without-pip /opt/venv
  mkdir /opt/empty
  mkdir -p -m 700 /opt/private/t2-drive
fi
if ls $wheels/*.whl >/dev/null 2>&1; then
  export PIP_NO_INDEX=1 PIP_FIND_LINKS=$wheels
fi
if [ "$1" = t2 ]; then
  own=$(ls $wheels/t2-*.whl $wheels/t2_sdk-*.whl 2>/dev/null || echo $source $source/sdk)
  # shellcheck disable=SC2086 # two packages
  set -- --no-deps $own
else
  set -- --require-hashes -r "$source/$1"
fi
exec /opt/pip/bin/pip --python /opt/venv/bin/python install --quiet --no-compile "$@"
