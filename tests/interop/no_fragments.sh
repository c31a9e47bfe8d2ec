#!/usr/bin/env bash
# Frames of 1 MB from one host to another over a cable that loses one packet in a thousand: no IP fragment is on the wire, the kernel
# has nothing to put together, and a loop's state beside them arrives. By a reliable profile every frame arrives, at any loss.
# no_fragments.sh PEER [SECONDS [FRAMES_A_SECOND [LOST_OF_A_THOUSAND [PROFILE]]]]
set -euo pipefail
source "$(dirname "$0")/two_namespaces.sh"
as_root "$@"
peer=$1 seconds=${2:-5} rate=${3:-10} lost=${4:-1} profile=${5:-image}
two_namespaces 10.78.0.11 10.78.0.12
ip netns exec "$b" nft -f - <<N
table inet loss { chain in { type filter hook input priority 0; udp dport 7400-65535 numgen random mod 1000 < $lost counter drop; }; }
N
ip netns exec "$a" dumpcap -q -B 64 -s 64 -i cable -w "$folder/cable.pcapng" >/dev/null 2>"$folder/dumpcap" &
capture=$!; pids+=("$capture")
for _ in $(seq 100); do grep -q 'File:' "$folder/dumpcap" && break; sleep 0.1; done
sleep 2
ip netns exec "$a" "$peer" writer 10.78.0.11 "$seconds" "$rate" "$profile" >"$folder/sent" & writer=$!; pids+=("$writer")
ip netns exec "$b" "$peer" reader 10.78.0.12 "$seconds" "$rate" "$profile" | tee "$folder/read"
wait "$writer"
cat "$folder/sent"
sleep 1
kill -INT "$capture"; wait "$capture" || true
pids=()
requests=$(ip netns exec "$b" awk '/^Ip:/ && $2 ~ /[0-9]/ {print $15}' /proc/net/snmp)
fragments=$(tshark -n -r "$folder/cable.pcapng" -Y 'ip.flags.mf == 1 or ip.frag_offset > 0' 2>/dev/null | wc -l)
longest=$(tshark -n -r "$folder/cable.pcapng" -T fields -e frame.len 2>/dev/null | sort -n | tail -1)
echo "IP fragments on the wire: $fragments; asked to put together: $requests; longest frame: $longest octets"
read -r _ frames _ wrong _ states <"$folder/read"
[[ $fragments == 0 && $requests == 0 ]] || { echo "IP fragments"; exit 1; }
((wrong == 0)) || { echo "wrong pixels"; exit 1; }
((states > seconds * 80)) || { echo "the loop's state did not arrive: $states of $((seconds * 100))"; exit 1; }
((frames > 0)) || { echo "no frame arrived"; exit 1; }
read -r _ sent _ <"$folder/sent"
[[ $profile == image || $frames == "$sent" ]] || { echo "$frames of $sent frames arrived by a reliable profile"; exit 1; }
