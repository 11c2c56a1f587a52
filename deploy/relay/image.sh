#!/bin/sh
# Make a single-board computer's root file system into a relay.
#
#   sudo sh deploy/relay/image.sh ROOT             ROOT: the mounted root of the board's own Debian
#   sudo sh deploy/relay/image.sh ROOT arm64       make the root first, with debootstrap; kernel and
#                                                  boot loader are those of the single-board computer
#
# It needs Debian 12 or newer in ROOT: systemd 252 and Python 3.11. See docs/relay.md.
set -eu

usage() {
	echo "usage: image.sh ROOT [ARCHITECTURE]" >&2
	exit 64
}

case $# in 1 | 2) ;; *) usage ;; esac
root=$1
here=$(cd "$(dirname "$0")" && pwd)

if [ $# -eq 2 ]; then
	packages=systemd-sysv,udev,kmod,iproute2,python3
	debootstrap --arch="$2" --variant=minbase --include="$packages" bookworm "$root"
fi
[ -x "$root/usr/bin/python3" ] || {
	echo "image.sh: $root has no usr/bin/python3: install python3 there, or name an architecture" >&2
	exit 66
}

# The program: a copy of one folder.
rm -rf "$root/opt/t2/relay"
install -d "$root/opt/t2/relay"
install -m 644 "$here"/../../services/relay/*.py "$root/opt/t2/relay"

# The unit, and the two interfaces. `ip link` shows their names: edit [Match] if they differ.
install -m 644 "$here/t2-relay.service" "$root/etc/systemd/system/"
install -d "$root/etc/systemd/network"
install -m 644 "$here/10-board.network" "$here/20-pc.network" "$root/etc/systemd/network/"
systemctl --root="$root" enable t2-relay.service systemd-networkd.service

# No packet crosses the relay unless the program passes it.
install -d "$root/etc/sysctl.d"
cat >"$root/etc/sysctl.d/90-t2-relay.conf" <<'END'
net.ipv4.ip_forward = 0
net.ipv4.conf.all.rp_filter = 1
net.ipv4.conf.all.arp_ignore = 2
net.ipv6.conf.all.disable_ipv6 = 1
kernel.panic = 1
kernel.panic_on_oops = 1
END

# The hardware watchdog restarts a computer whose kernel hangs.
install -d "$root/etc/systemd/system.conf.d"
printf '[Manager]\nRuntimeWatchdogSec=2s\n' >"$root/etc/systemd/system.conf.d/90-t2-relay.conf"

# The log stays in memory, so that the power can be cut at any time.
install -d "$root/etc/systemd/journald.conf.d"
printf '[Journal]\nStorage=volatile\n' >"$root/etc/systemd/journald.conf.d/90-t2-relay.conf"

echo "$root is a relay; mount it read-only (ro in its /etc/fstab)"
