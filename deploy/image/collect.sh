#!/bin/sh
# collect.sh FOLDER: copy the runtime of /opt/venv into FOLDER, without files that an earlier call has
# copied: Python, its library, their shared libraries, and the venv. It also compiles byte code: the
# images are read-only, and without it each start would compile all imports.
set -eu
export LC_ALL=C
to=$1
had=/opt/collected
first=
[ -e $had ] || { first=yes && touch $had; }
mkdir -p "$to"
python=$(command -v python3)
library=$(python3 -c 'import sysconfig; print(sysconfig.get_path("stdlib"))')

# Excluded: Python's tests, build files, Tk and NIS. Files that end in _cffi are for PyPy.
find "$library" \( -name test -o -name tests -o -name idlelib -o -name tkinter -o -name turtledemo \
    -o -name ensurepip -o -name distutils -o -name lib2to3 -o -name pydoc_data -o -name 'config-3*' \
    -o -name site-packages -o -name dist-packages -o -name __pycache__ -o -name sitecustomize.py \
    -o -name '_tkinter*' -o -name '_test*' -o -name '_ctypes_test*' -o -name 'xxlimited*' \
    -o -name 'nis.*' -o -name '_dbm.*' -o -name '_gdbm.*' \) -prune \
  -o ! -type d -print >/opt/files
# Excluded: tests, manuals, examples and stubs of packages.
find /opt/venv \( -name __pycache__ -o -name tests -o -name '*.pyi' -o -path '*/zstandard/_cffi*' \
    -o -path '*/pygame/docs' -o -path '*/pygame/examples' \) -prune -o ! -type d -print >>/opt/files
# Remove debug symbols, if the base has binutils. strip breaks libraries that auditwheel has patched,
# so strip only extensions without bundled libraries.
if command -v strip >/dev/null; then
  grep -E '^/opt/venv/.*(\.abi3\.so|/zstandard/.*\.so)$' /opt/files | xargs -r strip --strip-unneeded
fi
# Copy each library under its requested name, and follow links.
grep '\.so' /opt/files | xargs ldd "$python" 2>/dev/null \
  | sed -n 's/^\t\(.* => \)\{0,1\}\(\/[^ ]*\) (0x.*/\2/p' | sort -u | grep -v '^/opt/venv/' >/opt/links
echo "$python" >>/opt/links

sort -u /opt/files /opt/links | comm -23 - $had >/opt/new
sort -u /opt/links | comm -12 - /opt/new | sed "s,^/,," | tar -C / -c -h -T - | tar -x -C "$to"
sort -u /opt/links | comm -13 - /opt/new | sed "s,^/,," | tar -C / -c --hard-dereference -T - | tar -x -C "$to"
sort -u /opt/new $had >$had.now && mv $had.now $had

python3 -m compileall -q -s "$to" -p / --invalidation-mode unchecked-hash "$to"
if [ "$first" ]; then
  mkdir -m 1777 "$to/tmp"
  cp -rL --parents /etc/ld.so.conf* "$to"
  ldconfig -r "$to"
fi
