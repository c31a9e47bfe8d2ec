#!/usr/bin/env bash
# Two hosts as two network namespaces joined by a cable (veth): the same program on both ends, and tshark, which must
# show the cell's traffic by topic. Argument: the program. Needs root or a kernel that lets users have namespaces.
set -euo pipefail
if ((EUID != 0)); then exec unshare --map-root-user --net --mount bash -c 'mount -t tmpfs tmpfs /run && exec "$0" "$@"' "$0" "$@"; fi
peer=$1
a=invar-a-$$ b=invar-b-$$ work=$(mktemp -d)
pids=()
clean() {
  for pid in "${pids[@]}"; do kill "$pid" 2>/dev/null || true; done
  wait
  ip netns del "$a" 2>/dev/null || true
  ip netns del "$b" 2>/dev/null || true
  rm -rf "$work"
}
trap clean EXIT

ip netns add "$a"; ip netns add "$b"
ip -n "$a" link add cable type veth peer name cable netns "$b"
for end in "$a 10.77.0.11" "$b 10.77.0.12"; do
  read -r name address <<<"$end"
  ip -n "$name" address add "$address/24" dev cable
  ip -n "$name" link set cable up
  ip -n "$name" link set lo up
done
# The kernel says "up" some seconds before the first packets pass.
for _ in $(seq 100); do
  ip -n "$a" link show cable | grep -q 'LOWER_UP' && ip -n "$b" link show cable | grep -q 'LOWER_UP' && break; sleep 0.1
done

# First everything into a file: a busy machine must not make the dissector lose the discovery that names the topics.
ip netns exec "$a" tshark -n -B 32 -i cable -w "$work/cable.pcapng" >/dev/null 2>"$work/tshark" &
capture=$!; pids+=("$capture")
for _ in $(seq 100); do grep -q 'Capturing' "$work/tshark" && break; sleep 0.1; done
sleep 2

ip netns exec "$a" "$peer" writer 10.77.0.11 & writer=$!; pids+=("$writer")
ip netns exec "$b" "$peer" reader 10.77.0.12
wait "$writer"
sleep 1
kill -INT "$capture"; wait "$capture" || true
# Fields: which topic a sample belongs to, as tshark learns it from discovery. Kinds 2 and 3: writers of users.
tshark -n -2 -r "$work/cable.pcapng" -Y 'rtps.sm.id == 0x15 && (rtps.sm.wrEntityId.entityKind == 0x02)' \
  -T fields -e rtps.param.topicName >"$work/topics" 2>>"$work/tshark"
echo "traffic by topic, as tshark sees it on the cable:"
tr ',' '\n' <"$work/topics" | sort | uniq -c | sort -rn
for topic in axis/state heat/node axis/command; do
  grep -q "cell/two-hosts/$topic" "$work/topics" || { echo "tshark saw no sample of $topic"; cat "$work/tshark"; exit 1; }
done
