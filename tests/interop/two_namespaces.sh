# Sourced by the tests of two PCs: two network namespaces $a and $b joined by a cable (veth), and a folder $folder that goes at the end
# with them and with the processes in ${pids[@]}. First `as_root "$@"`: without root it begins the script anew in namespaces of its own,
# if the kernel lets users have them; then two_namespaces ADDRESS_A ADDRESS_B.
pids=()
two_namespaces() {
  a=invar-a-$$ b=invar-b-$$ folder=$(mktemp -d)
  spaces=("$a" "$b")
  trap leave_namespaces EXIT
  ip netns add "$a"; ip netns add "$b"
  ip -n "$a" link add cable type veth peer name cable netns "$b"
  local end name address
  for end in "$a $1" "$b $2"; do
    read -r name address <<<"$end"
    ip -n "$name" address add "$address/24" dev cable
    ip -n "$name" link set cable up
    ip -n "$name" link set lo up
  done
  for _ in $(seq 100); do
    ip -n "$a" link show cable | grep -q 'LOWER_UP' && ip -n "$b" link show cable | grep -q 'LOWER_UP' && break; sleep 0.1
  done
}

# Ends ${pids[@]}, and removes ${spaces[@]} and $folder.
leave_namespaces() {
  for pid in "${pids[@]}"; do kill -INT "$pid" 2>/dev/null || true; done
  wait
  local space
  for space in "${spaces[@]}"; do ip netns del "$space" 2>/dev/null || true; done
  rm -rf "$folder"
}

as_root() {
  if ((EUID != 0)); then exec unshare --map-root-user --net --mount bash -c 'mount -t tmpfs tmpfs /run && exec "$0" "$@"' "$0" "$@"; fi
}
