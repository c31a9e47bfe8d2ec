#!/usr/bin/env bash
# The packages on a PC with nothing on it: a fresh Debian by debootstrap, in which apt fetches what the packages name. They are
# installed, run a cell, and are purged. bare_packages.sh PACKAGES_FOLDER [MIRROR]; needs root and a mirror, takes two minutes.
set -euo pipefail
packages=$(realpath "$1") mirror=${2:-}
bare=$(mktemp -d)
chmod 755 "$bare"  # apt fetches as a user of its own
leave() { umount "$bare/proc" "$bare/dev/shm" 2>/dev/null || true; rm -rf "$bare"; }
trap leave EXIT
debootstrap --variant=minbase bookworm "$bare" $mirror >"$bare.log" 2>&1 || { tail "$bare.log"; exit 1; }
rm -f "$bare.log"
echo "debootstrap: $SECONDS s"
cp /etc/resolv.conf "$bare/etc/resolv.conf"
mount -t proc proc "$bare/proc"
mkdir -p "$bare/dev/shm"; mount -t tmpfs tmpfs "$bare/dev/shm"
inside() { chroot "$bare" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin DEBIAN_FRONTEND=noninteractive "$@"; }
mkdir "$bare/packages"; cp "$packages"/invar-*.deb "$bare/packages"
inside bash -c 'find /usr /etc /var | sort' >"$bare/before"
begin=$SECONDS
inside apt-get -qq update
inside bash -c 'apt-get -qq install --no-install-recommends -y /packages/invar-runtime_*.deb >/dev/null 2>&1'
echo "installed invar-runtime with what it needs: $((SECONDS - begin)) s, $(inside dpkg-query -W -f '${Package}\n' | wc -l) packages in all"
inside invar --version
inside getent passwd invar
inside invar check /usr/share/invar/deployment/xy-table.yaml
mkdir "$bare/cell"
in_a_network_of_its_own() { unshare -n bash -c 'ip link set lo up; exec "$@"' bash "$@"; }
in_a_network_of_its_own chroot "$bare" bash -c 'cd /cell && invar run /usr/share/invar/deployment/xy-table.yaml --simulated --duration 2 --quiet >/dev/null'
ls -l "$bare/cell/out/xy-table/recording.mcap"
inside bash -c 'apt-get -qq purge -y invar-runtime >/dev/null 2>&1'
left=$(inside bash -c "find /usr /etc /var/lib/dpkg/info -name '*invar*'")
[[ -z $left ]] || { echo "left behind: $left"; exit 1; }
echo "purged; nothing is left"
