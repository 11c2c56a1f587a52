#!/bin/sh
# base.sh TAG [MIRROR]: create the base image TAG (`--build-arg BASE=TAG`) from Debian packages, for
# hosts without a registry. Needs root, Docker and debootstrap. SUITE selects another release; its
# Python version must match the wheelhouse.
set -eu
root=$(mktemp -d)
trap 'rm -rf "$root"' EXIT
debootstrap --variant=minbase --include=python3-venv,binutils "${SUITE:-bookworm}" "$root" ${2:+"$2"}
rm -rf "$root"/var/cache/apt/* "$root"/var/lib/apt/lists/*
tar -C "$root" -c . | docker import --message "Debian ${SUITE:-bookworm} by debootstrap" - "$1"
