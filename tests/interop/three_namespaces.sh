# Sourced by the tests of three PCs: three network namespaces ${pc[0]}, ${pc[1]}, ${pc[2]} at a bridge, with the addresses
# 10.81.0.11, .12 and .13, and a folder $folder that goes at the end with them and with the processes in ${pids[@]}.
# First `as_root "$@"` of two_namespaces.sh.
source "$(dirname "${BASH_SOURCE[0]}")/two_namespaces.sh"
three_namespaces() {
  pc=(invar-0-$$ invar-1-$$ invar-2-$$) switch=invar-switch-$$ folder=$(mktemp -d)
  spaces=("${pc[@]}" "$switch")
  trap leave_namespaces EXIT
  ip netns add "$switch"
  ip -n "$switch" link add name bridge type bridge mcast_snooping 0
  ip -n "$switch" link set bridge up
  local i
  for i in 0 1 2; do
    ip netns add "${pc[$i]}"
    ip -n "${pc[$i]}" link add cable type veth peer name "port$i" netns "$switch"
    ip -n "$switch" link set "port$i" master bridge up
    ip -n "${pc[$i]}" address add "10.81.0.1$((i + 1))/24" dev cable
    ip -n "${pc[$i]}" link set cable up
    ip -n "${pc[$i]}" link set lo up
  done
  sleep 2  # the kernel says "up" before the first packets pass
}
# apart HOST COMMAND... &: on a PC with a /dev/shm of its own, as PCs have; takes the place of the shell that it runs in.
apart() { exec ip netns exec "${pc[$1]}" unshare --mount bash -c 'mount -t tmpfs tmpfs /dev/shm && exec "$@"' pc "${@:2}"; }
on() { local i=$1; shift; ip netns exec "${pc[$i]}" "$@"; }
# The cable of a PC: out is seen by the PC itself (no carrier), cut is not (the switch passes nothing).
cable() { ip -n "$switch" link set "port$1" "$2"; }
cut() { ip netns exec "$switch" nft "table bridge cut$1 { chain c { type filter hook forward priority 0; iifname \"port$1\" drop; oifname \"port$1\" drop; }; }"; }
mend() { ip netns exec "$switch" nft delete table bridge "cut$1"; }
no_multicast() { local i; for i in 0 1 2; do on "$i" nft 'table inet group { chain out { type filter hook output priority 0; ip daddr 224.0.0.0/4 drop; }; }'; done; }
with_multicast() { local i; for i in 0 1 2; do on "$i" nft delete table inet group; done; }

# milliseconds COMMAND...: until it succeeds, at most 30 s.
milliseconds() {
  local begin=${EPOCHREALTIME/./}
  until "$@" >/dev/null 2>&1; do
    (((${EPOCHREALTIME/./} - begin) / 1000 < 30000)) || { echo 30000; return; }
    sleep 0.02
  done
  echo $(((${EPOCHREALTIME/./} - begin) / 1000))
}
