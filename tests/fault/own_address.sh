#!/usr/bin/env bash
# A PC whose address comes late, never, goes and comes back, or is not that of the file; and a firewall. Two PCs are two network
# namespaces. own_address.sh INVAR SOURCE_DIR
set -euo pipefail
source "$(dirname "$0")/../interop/two_namespaces.sh"
as_root "$@"
invar=$1 source=$2
two_namespaces 10.79.0.11 10.79.0.12
cp "$source/deployment/profiles.yaml" "$folder"
cd "$folder"
cat >cell.yaml <<'Y'
invar_cell: 1
name: lonely
domain: 9
time: real
profiles: profiles.yaml
address_wait: 20
hosts: {pc: {address: 10.79.0.11}}
processes:
  watch: {host: pc, rate: 10, components: {supervisor: {type: supervisor}}}
Y
sed 's/address_wait: 20/address_wait: 0.5/' cell.yaml >hasty.yaml
on() { local pc=$1; shift; ip netns exec "$pc" "$@"; }
fail() { echo "$*"; tail -n 30 ./*.log; exit 1; }
says() { grep -qE "$1" "$2" || fail "$2 does not say: $1"; }
until_says() { for _ in $(seq 200); do grep -qE "$1" "$2" && return; sleep 0.1; done; fail "$2 never says: $1"; }
no_raw_lines() { ! grep -E '^[0-9-]+ [0-9:.]+ \[|RTPS_' "$1" || fail "$1 has lines of the middleware"; }

# It never comes, or this PC is no host at all: a status that a service manager sees, and the reason.
ip -n "$a" address del 10.79.0.11/24 dev cable
status=0; on "$a" "$invar" run hasty.yaml --host pc >/dev/null 2>never.log || status=$?
((status == 1)) || fail "without its address: status $status"
says 'hosts.pc: no running interface of this PC has 10.79.0.11; it has 127.0.0.1 \(lo\)' never.log
status=0; on "$b" "$invar" run cell.yaml >/dev/null 2>nobody.log || status=$?
((status == 2)) || fail "a PC that is no host: status $status"
says 'hosts: this PC is none of them \(pc 10.79.0.11\); it has .*10.79.0.12' nobody.log
status=0; on "$b" "$invar" run cell.yaml --host pd >/dev/null 2>name.log || status=$?
((status == 2)) || fail "a host that is none: status $status"
says '`pd` is no host of' name.log
echo "never there, no host: passed"

# It comes late; then it goes and comes back. The other PC sees the cell.
ip netns exec "$a" "$invar" run cell.yaml --host pc >/dev/null 2>late.log & run=$!; pids+=("$run")
until_says 'waiting 20 s for it' late.log
sleep 1
ip -n "$a" address add 10.79.0.11/24 dev cable
until_says '10.79.0.11 is there' late.log
on "$b" "$invar" status cell.yaml --wait 20 >seen.log 2>&1 || fail "the other PC does not see the cell"
ip -n "$a" address del 10.79.0.11/24 dev cable
until_says 'no running interface of this PC has 10.79.0.11 any more' late.log
ip -n "$a" address add 10.79.0.11/24 dev cable
until_says '10.79.0.11 is back' late.log
on "$b" "$invar" status cell.yaml --wait 20 >again.log 2>&1 || fail "the other PC does not see the cell again"
ip -n "$a" link set cable down
for _ in $(seq 100); do (($(grep -c 'any more' late.log) == 2)) && break; sleep 0.1; done
(($(grep -c 'any more' late.log) == 2)) || fail "late.log does not say that the cable is out"
ip -n "$a" link set cable up
for _ in $(seq 100); do (($(grep -c 'is back' late.log) == 2)) && break; sleep 0.1; done
on "$b" "$invar" status cell.yaml --wait 20 >cable.log 2>&1 || fail "the other PC does not see the cell after the cable was out"
for log in *.log; do no_raw_lines "$log"; done
echo "late, gone and back, cable out: passed"

# A firewall: doctor finds it, and who does not find the cell is told of it.
on "$a" "$invar" doctor cell.yaml >doctor.log 2>&1 || true
says '^good +host pc: 10.79.0.11 is here, discovery passes' doctor.log
says 'UDP 9650, 9660-9879' doctor.log
on "$a" nft 'table inet wall { chain in { type filter hook input priority 0; iifname "cable" udp dport 9650-9879 drop; }; }'
on "$a" "$invar" doctor cell.yaml >doctor.log 2>&1 && fail "doctor sees no firewall"
says '^BAD +host pc: .*239.255.0.1:9650 does not come back' doctor.log
on "$b" nft 'table inet wall { chain in { type filter hook input priority 0; iifname "cable" udp dport 9650-9879 drop; }; }'
status=0; on "$b" "$invar" status cell.yaml --wait 3 >wall.log 2>&1 || status=$?
((status != 0)) || fail "the cell is seen through a wall"
says 'no cell answers in domain 9, whose hosts are 10.79.0.11 .*this PC has .*10.79.0.12.*UDP 9650, 9660-9879 in the firewalls' wall.log
kill -INT "$run"; wait "$run" || fail "the cell did not end in order"
pids=()
echo passed
