#!/usr/bin/env bash
# Two processes of one PC that cannot use one shared memory: two users, two /dev/shm in one network, a small, full, read-only or
# missing /dev/shm. All samples arrive, no thread spins, and the reason is told. one_pc.sh PEER users|folders|memory
set -euo pipefail
peer=$1 part=$2
if [[ -z ${INVAR_OWN_SPACE-} ]]; then
  options=(--net --mount --ipc)
  ((EUID == 0)) || options+=(--map-root-user)
  INVAR_OWN_SPACE=1 exec unshare "${options[@]}" bash "$0" "$@"
fi
ip link set lo up
ip link set lo multicast on
ip route add 224.0.0.0/4 dev lo 2>/dev/null || true
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
chmod 755 "$folder"
mount -t tmpfs -o size=1g tmpfs /dev/shm
fail() { echo "$*"; cat "$folder"/*; exit 1; }

# both NAME_OF_CASE "COMMAND OF A" "COMMAND OF B" WHAT_IS_TOLD [PRIORITY] [WHAT_HAPPENS_MEANWHILE]
both() {
  local case=$1 told=$4 priority=${5-0} meanwhile=${6-true}
  $2 "$peer" a b 4 "$priority" >"$folder/a" 2>&1 & local first=$!
  (sleep 1.5; $meanwhile) &
  $3 "$peer" b a 4 "$priority" >"$folder/b" 2>&1 || fail "$case: b ended with a fault"
  wait "$first" || fail "$case: a ended with a fault"
  for side in a b; do
    sed "s/^/$case, $side: /" "$folder/$side"
    awk '/^came/ { c = $2; of = $4 + 0; slow = $6 + 0; cpu = $8 + 0; age = $12 } END { exit !(age < 3 && c >= 300 && c >= 0.98 * of && slow >= 6 && cpu < 0.3) }' \
      "$folder/$side" || fail "$case: $side did not hear its peer, or a thread spins"
    grep -q "segments $segments" "$folder/$side" || fail "$case: $side has opened other memory than $segments"
    [[ -n $told ]] || ! grep -q '^told' "$folder/$side" || fail "$case: $side was told of a fault that is none"
  done
  [[ -z $told ]] || (($(grep -lE "$told" "$folder/a" "$folder/b" | wc -l) >= sides)) || fail "$case: nothing told of it"
}
# May ask for real-time priority, so that a thread that spins is seen on a loaded machine too.
other_user() {
  setpriv --reuid=nobody --regid=nogroup --clear-groups --inh-caps +sys_nice --ambient-caps +sys_nice "$@"
}
other_folder() { unshare --mount bash -c 'mount -t tmpfs -o size=1g tmpfs /dev/shm; exec "$@"' own "$@"; }
sleep_and() { sleep 0.5; "$@"; }

segments=4 sides=2  # two of each process; both are told
fill() { head -c 2G /dev/zero >/dev/shm/fill || true; }

case $part in
users)
  both "one user" env env ""
  segments=2
  if ((EUID == 0)) && other_user test -x "$peer"; then
    for priority in 0 70; do both "two users, priority $priority" env other_user 'told .*as user' $priority; done
    both "two users, turned" other_user env 'told .*as user'
    segments=4
    # Without the mend one message of another user's segment holds a receiver for ever.
    both "another program's message" other_user other_user "" 70 "$peer --foreign"
  fi
  ;;
folders)
  segments=2
  for priority in 0 70; do both "two folders, priority $priority" env other_folder 'told .*another /dev/shm' $priority; done
  ;;
memory)
  sides=1
  both "filled later" env env "" 0 fill
  rm /dev/shm/fill
  for size in 64m 24m 16m 1m 4k; do
    mount -t tmpfs -o size=$size tmpfs /dev/shm
    told="told shared memory: /dev/shm" segments='[0-4]'
    [[ $size != 64m ]] || told="" segments=4
    both "$size" env "sleep_and env" "$told"
    umount /dev/shm
  done
  mount -t tmpfs -o size=16m,ro tmpfs /dev/shm
  segments=0
  both "read-only" env env 'told .*cannot be written'
  ;;
esac
echo passed
