#!/usr/bin/env bash
# Two hosts as two network namespaces joined by a cable (veth): the same program on both ends, and tshark, which must
# show the cell's traffic by topic. Argument: the program.
set -euo pipefail
source "$(dirname "$0")/two_namespaces.sh"
as_root "$@"
peer=$1
two_namespaces 10.77.0.11 10.77.0.12

# First everything into a file: a busy machine must not make the dissector lose the discovery that names the topics.
# dumpcap says how many packets it lost; then one of those that name a topic may be missing, and the cable is watched anew.
for attempt in 1 2 3; do
  ip netns exec "$a" dumpcap -q -B 64 -i cable -w "$folder/cable.pcapng" >/dev/null 2>"$folder/tshark" &
  capture=$!; pids+=("$capture")
  for _ in $(seq 100); do grep -q 'File:' "$folder/tshark" && break; sleep 0.1; done
  sleep 2

  ip netns exec "$a" "$peer" writer 10.77.0.11 & writer=$!; pids+=("$writer")
  ip netns exec "$b" "$peer" reader 10.77.0.12
  wait "$writer"
  sleep 1
  kill -INT "$capture"; wait "$capture" || true
  pids=()
  grep -E 'received/dropped.*: *[0-9]+/0 ' "$folder/tshark" && break
  echo "attempt $attempt: the capture lost packets"; cat "$folder/tshark"
done
# Fields: which topic a sample belongs to, as tshark learns it from discovery. Kinds 2 and 3: writers of users.
tshark -n -2 -r "$folder/cable.pcapng" -Y 'rtps.sm.id == 0x15 && (rtps.sm.wrEntityId.entityKind == 0x02)' \
  -T fields -e rtps.param.topicName >"$folder/topics" 2>>"$folder/tshark"
echo "traffic by topic, as tshark sees it on the cable:"
tr ',' '\n' <"$folder/topics" | sort | uniq -c | sort -rn
for topic in axis/state heat/node axis/command; do
  grep -q "cell/two-hosts/$topic" "$folder/topics" || { echo "tshark saw no sample of $topic"; cat "$folder/tshark"; exit 1; }
done
