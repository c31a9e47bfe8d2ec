# Sourced by tests that run a cell by themselves: a network namespace of their own with loopback and multicast, a scratch folder as
# the working folder, and an end that stops all processes in `pids`. Sets invar, source, folder. alone "$@", with INVAR SOURCE_DIR
alone() {
  if [[ -z ${INVAR_ALONE:-} ]]; then exec env INVAR_ALONE=1 unshare --map-root-user --net bash -c 'ip link set lo up; ip link set lo multicast on; exec "$0" "$@"' "$0" "$@"; fi
  invar=$1 source=$2
  folder=$(mktemp -d)
  pids=()
  trap leave EXIT
  cp "$source/deployment/profiles.yaml" "$source/deployment/maps/heater.yaml" "$folder"
  cd "$folder"
}
leave() { for pid in "${pids[@]}"; do kill -INT "$pid" 2>/dev/null || true; done; wait; rm -rf "$folder"; }
