// Scripts that run on the PCs of a cell during a deployment: POSIX shell and the tools that each Debian has.
#pragma once

#include <string>

namespace invar::tools::scripts {

// The folder of a cell on its PC, $1:
//   store/SHA256        each content once, read-only; a program as SHA256.x
//   releases/NAME/      hard links into the store, and MANIFEST; whole from the moment that it has its name
//   current, previous   links to releases; `current` is what runs
//   keys/               of a secured cell, those of this PC alone; no part of a release
//   data/               where the cell runs: recordings, state; of the service's user

/// Said by a script that ends by itself: the deployment acts on the status.
inline constexpr int damaged = 3, not_told = 4, changed = 5, not_started = 6;

inline const std::string common = R"sh(
set -eu
umask 022
export LC_ALL=C
home=$1
shift
at() { if [ -L "$home/$1" ]; then l=$(readlink "$home/$1"); echo "${l#releases/}"; else echo -; fi; }
point() {  # point LINK RELEASE: at once or not at all
  if [ "$2" = - ]; then rm -f "$home/$1"; return; fi
  rm -f "$home/.$1.$$"
  ln -s "releases/$2" "$home/.$1.$$"
  mv -T "$home/.$1.$$" "$home/$1"
}
root() { if [ "$(id -u)" = 0 ]; then "$@"; else sudo -n "$@"; fi; }
)sh";

/// Units of the current release, for PCs with systemd.
inline const std::string with_units = common + R"sh(
units=/etc/systemd/system
own() {  # the links of this cell's units
  for link in "$units"/*.service; do
    case $(readlink "$link" || true) in "$home/current/units/"*) echo "${link##*/}" ;; esac
  done
}
drop() { root systemctl stop "$1" || true; root rm -f "$units/multi-user.target.wants/$1" "$units/$1"; }
runs() {  # a call that was cut off may have left the link new and the program old
  pid=$(systemctl show -P MainPID "$1")
  [ "$(root readlink "/proc/$pid/exe" || true)" = "$(realpath "$home/current")/bin/invar" ]
}
start() {  # start HOST UNIT PATIENCE VERB: UNIT first, then the others of the host; those that the release does not have go
  for name in $(own); do [ -e "$units/$name" ] || drop "$name"; done
  root mkdir -p "$units/multi-user.target.wants"
  for file in "$home/current/units/$1"/*.service; do
    root ln -sfn "$file" "$units/${file##*/}"
    root ln -sfn "../${file##*/}" "$units/multi-user.target.wants/${file##*/}"
  done
  root systemctl daemon-reload
  for name in "$2" $(own); do
    [ "$name" != "$2" ] || [ "${started:-no}" = no ] || continue
    started=yes
    verb=restart
    [ "$4" = restart ] || ! runs "$name" || verb=start
    root timeout "$3" systemctl "$verb" "$name" || { root systemctl status --no-pager -n 20 "$name" >&2 || true; exit 6; }
  done
}
)sh";

/// Changes nothing. HOME
inline const std::string state = common + R"sh(
echo "current $(at current)"
echo "previous $(at previous)"
)sh";

/// Input: names of contents. Says what is there, and which contents are missing. With a user, the service's, sees that it exists.
/// HOME SERVICE USER
inline const std::string look = common + R"sh(
mkdir -p "$home" 2>/dev/null || root mkdir -p "$home"
if ! [ -w "$home" ]; then  # made just now, or by a call that was cut off
  there=$(root ls -A "$home")
  [ -n "$there" ] || root chown "$(id -u):$(id -g)" "$home"
fi
mkdir -p "$home/store" "$home/releases"
[ -d "$home/data" ] || mkdir -m 0750 "$home/data"
if [ "$1" = systemd ]; then
  [ -d /run/systemd/system ] || { echo "systemd does not run there; --service none leaves the start to others" >&2; exit 1; }
  if ! getent passwd "$2" >/dev/null; then
    root useradd --system --user-group --no-create-home --home-dir "$home/data" --shell /usr/sbin/nologin "$2"
  fi
  [ "$(stat -c %U "$home/data")" = "$2" ] || root chown -R "$2:" "$home/data"
fi
find "$home/store" "$home/releases" -maxdepth 1 -name '.part.*' -cmin +60 -exec rm -rf {} +
echo "machine $(uname -m)"
echo "current $(at current)"
echo "previous $(at previous)"
while read -r name; do [ -f "$home/store/$name" ] || echo "missing $name"; done
)sh";

/// Input: a tar archive of contents, each named by its sum. They are kept when all have arrived, and each is what it says.
inline const std::string receive = common + R"sh(
part=$home/store/.part.$$
trap 'rm -rf "$part"' EXIT
mkdir -m 0700 "$part"
tar -xf - -C "$part" --no-same-owner
cd "$part"
for f in *; do echo "${f%.x}  $f"; done | sha256sum -c --quiet --strict
for f in *; do
  case $f in *.x) chmod 0555 "$f" ;; *) chmod 0444 "$f" ;; esac
  mv -f "$f" "$home/store/$f"
done
)sh";

/// Input: the manifest. Makes the release of it, or mends one that is there; each file is summed up where it lies. HOME RELEASE
inline const std::string stage = common + R"sh(
release=$home/releases/$1
part=$home/releases/.part.$$
trap 'rm -rf "$part"' EXIT
mkdir "$part"
cat >"$part/MANIFEST"
[ "$(sha256sum <"$part/MANIFEST" | cut -c1-16)" = "$1" ] || { echo "the manifest did not arrive whole" >&2; exit 1; }
stored() { case $2 in bin/*) echo "$1.x" ;; *) echo "$1" ;; esac; }
drop_damaged() {  # of the store, by the sums of their contents
  while IFS= read -r line; do
    sum=${line%%  *} name=$home/store/$(stored "${line%%  *}" "${line#*  }")
    [ "$(sha256sum <"$name" | cut -c1-64)" = "$sum" ] || rm -f "$name"
  done <"$part/MANIFEST"
  exit 3
}
place() {  # each file, at once or not at all, where it is not there as it is in the store
  while IFS= read -r line; do
    path=$1/${line#*  } name=$home/store/$(stored "${line%%  *}" "${line#*  }")
    [ -d "${path%/*}" ] || mkdir -p "${path%/*}"
    [ "$path" -ef "$name" ] && continue
    ln -f "$name" "$path.$$"
    mv -f "$path.$$" "$path"
  done <"$part/MANIFEST"
}
if [ -d "$release" ]; then
  (cd "$release" && sha256sum -c --quiet --strict "$part/MANIFEST" >/dev/null 2>&1) && exit 0
  place "$release"
  (cd "$release" && sha256sum -c --quiet --strict "$part/MANIFEST" >/dev/null 2>&1) || drop_damaged
  exit 0
fi
place "$part"
if [ -f "$part/KEYS" ]; then
  keys=$part/$(cat "$part/KEYS")
  mkdir -p "${keys%/*}"
  ln -s "$home/keys" "$keys"
fi
(cd "$part" && sha256sum -c --quiet --strict MANIFEST >/dev/null 2>&1) || drop_damaged
mv -T "$part" "$release"
sync -f "$home"
)sh";

/// The judgement of the release on itself, on that PC. HOME RELEASE
inline const std::string check = common + R"sh(
cd "$home/data" 2>/dev/null || cd "$home"
release=$home/releases/$1
(cd "$release" && sha256sum -c --quiet --strict MANIFEST) >/dev/null || { echo "release $1 is not whole" >&2; exit 1; }
export LD_LIBRARY_PATH="$release/lib"
"$release/bin/invar" --version >/dev/null
"$release/bin/invar" check "$release/$(cat "$release/CELL")" >/dev/null
)sh";

/// Says that it is ready, and waits for the line `go`; without it nothing changes. Then the release is current, and its service
/// starts anew (VERB `restart`), or where it is not what runs (`start`). HOME RELEASE EXPECTED SERVICE UNIT HOST PATIENCE VERB
inline const std::string switch_over = with_units + R"sh(
exec 9>"$home/lock"
flock -w 10 9 || { echo "another deployment is at work there" >&2; exit 1; }
[ "$(at current)" = "$2" ] || { echo "the current release there is $(at current), no longer $2" >&2; exit 5; }
[ -d "$home/releases/$1" ] || { echo "there is no release $1" >&2; exit 1; }
echo ready
read -r go && [ "$go" = go ] || exit 4
trap '' HUP PIPE TERM INT
if [ "$2" != "$1" ]; then
  [ "$2" = - ] || point previous "$2"
  point current "$1"
  sync -f "$home"
fi
[ "$3" != systemd ] || start "$5" "$4" "$6" "$7"
)sh";

/// As it was before. HOME CURRENT PREVIOUS SERVICE UNIT HOST PATIENCE VERB
inline const std::string restore = with_units + R"sh(
exec 9>"$home/lock"
flock -w 60 9 || { echo "another deployment is at work there" >&2; exit 1; }
point previous "$2"
if [ "$1" = - ] && [ "$3" = systemd ]; then
  for name in $(own); do drop "$name"; done
  root systemctl daemon-reload
fi
point current "$1"
sync -f "$home"
[ "$3" = systemd ] && [ "$1" != - ] || exit 0
start "$5" "$4" "$6" "$7"
)sh";

/// In a secured cell by root, who reads the key of a viewer. HOME SECONDS
inline const std::string status = common + R"sh(
cd "$home/data" 2>/dev/null || cd "$home"
by() { if [ -f "$home/current/KEYS" ]; then root "$@"; else "$@"; fi; }
by env LD_LIBRARY_PATH="$home/current/lib" "$home/current/bin/invar" status "$home/current/$(cat "$home/current/CELL")" --wait "$1"
)sh";

/// Input: an archive of keys. Each file changes as a whole, and only where it is another; says which. HOME SERVICE USER
inline const std::string receive_keys = common + R"sh(
umask 077
part=$home/.keys.$$
trap 'rm -rf "$part"' EXIT
mkdir -m 0700 "$part"
tar -xf - -C "$part" --no-same-owner
cd "$part"
sha256sum -c --quiet --strict SHA256SUMS >/dev/null
rm SHA256SUMS
service=$1 user=$2
by() { if [ "$service" = systemd ]; then root "$@"; else "$@"; fi; }
# Under systemd folders and `public` are root's, and a file is another's only where it is plain, with no second name and with the
# rights below: the service's user, who may have owned all of it once, leads root nowhere.
folder() {  # MODE PATH, parents first
  if by test -L "$2"; then echo "$2 is a link: remove it there" >&2; exit 1; fi
  by test -d "$2" || by mkdir -m "$1" "$2"  # a user with sudo does not see into all
  [ "$service" = systemd ] || return 0
  root chown -h "root:$user" "$2"
  root chmod "$1" "$2"
}
is_as_it_should_be() {  # MODE OWNER PATH
  by test -f "$3" && ! by test -L "$3" || return 1
  [ "$service" = systemd ] || return 0
  [ "$(root stat -c '%a %U:%G %h' "$3")" = "$1 $2 1" ]
}
private=0700
[ "$service" != systemd ] || private=0750
folder 0755 "$home/keys"
folder 0755 "$home/keys/public"
find . -mindepth 1 -type d ! -path ./public | sort | while read -r name; do folder "$private" "$home/keys/${name#./}"; done
find . -type f | sort | while read -r name; do
  to=$home/keys/${name#./} mode=600 owner=$user:$user
  case $name in ./public/*) mode=644 owner=root:root ;; esac
  is_as_it_should_be "$mode" "$owner" "$to" && by cmp -s "$name" "$to" && continue
  if by test -d "$to" && ! by test -L "$to"; then echo "$to is a folder: remove it there" >&2; exit 1; fi
  by rm -rf "$to.new"
  by install -T -m "$mode" "$name" "$to.new"
  [ "$service" != systemd ] || root chown -h "$owner" "$to.new"
  by mv -fT "$to.new" "$to"
  echo "changed ${name#./}"
done
)sh";

/// Processes with another certificate start anew; the list of the revoked is read again by itself. HOME UNIT...
inline const std::string take_keys = common + R"sh(
root systemctl reload "$1"
shift
for name in "$@"; do root systemctl restart "$name"; done
)sh";

/// An archive of what the cell has calibrated, as the output. HOME
inline const std::string backup = common + R"sh(
root env LD_LIBRARY_PATH="$home/current/lib" "$home/current/bin/invar" backup "$home/current/$(cat "$home/current/CELL")" \
  --data "$home/data" --out -
)sh";

/// Input: such an archive. HOME SERVICE UNIT DRY; with DRY = yes it is judged, and nothing changes
inline const std::string restore_backup = common + R"sh(
invar() { root env LD_LIBRARY_PATH="$home/current/lib" "$home/current/bin/invar" "$@"; }
cell=$home/current/$(cat "$home/current/CELL")
if [ "$3" = yes ]; then invar restore "$cell" - --data "$home/data" --dry-run >/dev/null; exit; fi
ran=no
if [ "$1" = systemd ] && root systemctl is-active --quiet "$2"; then ran=yes; root systemctl stop "$2"; fi
invar restore "$cell" - --data "$home/data" >/dev/null && said=0 || said=$?
[ "$ran" = no ] || root systemctl start --no-block "$2"
exit "$said"
)sh";

/// Keeps the newest releases, and those that are linked; contents of no release go. HOME COUNT
inline const std::string clean = common + R"sh(
exec 9>"$home/lock"
flock -n 9 || exit 0
cd "$home/releases"
ls -1t | tail -n "+$(($1 + 1))" | while read -r name; do
  [ "$name" = "$(at current)" ] || [ "$name" = "$(at previous)" ] || rm -rf "$name"
done
find "$home/store" -type f -links 1 -cmin +60 -delete
)sh";

}  // namespace invar::tools::scripts
