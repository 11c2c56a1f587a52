#!/bin/sh
# base.sh TAG [MIRROR]: make the image TAG to build on (`--build-arg BASE=TAG`) from Debian's own
# packages, where no registry can be reached. Wants root, Docker and debootstrap. SUITE names
# another release; its Python has to be the one that the wheelhouse was made for.
set -eu
root=$(mktemp -d)
trap 'rm -rf "$root"' EXIT
debootstrap --variant=minbase --include=python3-venv,binutils "${SUITE:-bookworm}" "$root" ${2:+"$2"}
rm -rf "$root"/var/cache/apt/* "$root"/var/lib/apt/lists/*
tar -C "$root" -c . | docker import --message "Debian ${SUITE:-bookworm} by debootstrap" - "$1"
