#!/usr/bin/env bash
# A PC of its own kind on this one, for tests of what systemd does: systemd_pc.sh FOLDER NETWORK_NAMESPACE ADDRESS
# Debian's systemd is its PID 1, in namespaces of its own, over a throw-away layer above this PC's files: what it writes is gone with it.
# sshd listens on ADDRESS with FOLDER/host_key, for root and for `admin`, who may use sudo, by FOLDER/key.pub.
# It ends when this script is killed. Needs root.
# The libraries that Invar stands on are not there: what runs there must bring them. KEEP_LIBRARIES=1 leaves them.
set -euo pipefail
pc=$1 network=$2 address=$3
group=$(awk '$3 == "cgroup2" {print $2; exit}' /proc/mounts)/invar-pc-$$
mkdir -p "$pc/layer" "$pc/root" "$group"
echo $$ >"$group/cgroup.procs"
exec ip netns exec "$network" unshare --mount --pid --fork --uts --ipc --cgroup --kill-child bash -euc '
pc=$1 address=$2 root=$1/root
mount --make-rprivate /
mount -t tmpfs tmpfs "$pc/layer"
mkdir "$pc/layer/upper" "$pc/layer/work"
mount -t overlay overlay -o "lowerdir=/,upperdir=$pc/layer/upper,workdir=$pc/layer/work" "$root"
mount -t proc proc "$root/proc"
mount -t sysfs -o ro sysfs "$root/sys"
mount -t tmpfs tmpfs "$root/run"
mkdir "$root/run/lock" "$root/run/sshd"
mount -t tmpfs tmpfs "$root/dev"
for device in null zero full random urandom tty; do touch "$root/dev/$device"; mount --bind "/dev/$device" "$root/dev/$device"; done
ln -s /proc/self/fd "$root/dev/fd"
ln -s fd/0 "$root/dev/stdin"; ln -s fd/1 "$root/dev/stdout"; ln -s fd/2 "$root/dev/stderr"
mkdir "$root/dev/pts" "$root/dev/shm"
mount -t devpts -o newinstance,ptmxmode=0666,mode=620 devpts "$root/dev/pts"
ln -s pts/ptmx "$root/dev/ptmx"
mount -t tmpfs tmpfs "$root/dev/shm"
mount -t cgroup2 cgroup2 "$root/sys/fs/cgroup" 2>/dev/null || { mount -t tmpfs tmpfs "$root/sys/fs/cgroup"; mount -t cgroup2 cgroup2 "$root/sys/fs/cgroup"; }
[[ -n ${KEEP_LIBRARIES:-} ]] || rm -f "$root"/usr/lib/*-linux-gnu/lib{fastrtps,fastcdr,yaml-cpp,spdlog,fmt}.so*
mount -t tmpfs -o mode=1777 tmpfs "$root/tmp"
mount -t tmpfs tmpfs "$root/opt"
rm -f "$root/etc/machine-id"; tr -d - </proc/sys/kernel/random/uuid >"$root/etc/machine-id"
echo "${pc##*/}" >"$root/etc/hostname"
echo "admin:*:1999:1999::/:/bin/sh" >>"$root/etc/passwd"
echo "admin:x:1999:" >>"$root/etc/group"
[[ ! -d $root/etc/sudoers.d ]] || echo "admin ALL=(ALL) NOPASSWD: ALL" >"$root/etc/sudoers.d/admin"
units=$root/etc/systemd/system
rm -rf "$units"; mkdir "$units"
ln -s /dev/null "$units/systemd-tmpfiles-setup.service"
cp -r "$pc/keys" "$root/etc/pc"
cat >"$root/etc/pc/sshd_config" <<CONFIG
ListenAddress $address
HostKey /etc/pc/host_key
AuthorizedKeysFile /etc/pc/key.pub
UsePAM no
StrictModes no
PidFile none
MaxStartups 50
CONFIG
cat >"$units/pc.target" <<UNIT
[Unit]
Requires=basic.target pc-sshd.service
After=basic.target
UNIT
cat >"$units/pc-sshd.service" <<UNIT
[Service]
ExecStart=/usr/sbin/sshd -D -e -f /etc/pc/sshd_config
UNIT
cd "$root"
mkdir old
pivot_root . old
umount -l /old
exec env -i container=test PATH=/usr/sbin:/usr/bin:/sbin:/bin /lib/systemd/systemd --system --unit=pc.target
' systemd_pc "$pc" "$address"
