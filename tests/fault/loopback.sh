#!/usr/bin/env bash
# An unsecured cell says so wherever it is looked at. Without `hosts` it binds to the loopback alone and another PC neither sees
# nor commands it; with its address in `hosts` the same other PC does both. Two PCs are two network namespaces.
# loopback.sh INVAR SOURCE_DIR
set -euo pipefail
source "$(dirname "$0")/../interop/two_namespaces.sh"
as_root "$@"
invar=$1 source=$2
two_namespaces 10.79.0.11 10.79.0.12
cp "$source/deployment/profiles.yaml" "$source/deployment/maps/heater.yaml" "$folder"
cd "$folder"
cat >alone.yaml <<'Y'
invar_cell: 1
name: lonely
domain: 9
profiles: profiles.yaml
processes:
  watch: {rate: 10, components: {supervisor: {type: supervisor}}}
  loop: {realtime: {rate: 100}, components: {heater: {type: simulated_heater, map: heater.yaml, port: 1502}}}
Y
sed 's/^profiles/hosts: {pc: {address: 10.79.0.11}}\nprofiles/' alone.yaml >open.yaml
on() { local pc=$1; shift; ip netns exec "$pc" "$@"; }
fail() { echo "$*"; tail -n 30 ./*.log; exit 1; }
says() { grep -qE "$1" "$2" || fail "$2 does not say: $1"; }
begin() { ip netns exec "$a" "$invar" run "$1" >run.log 2>&1 & run=$!; pids=("$run"); on "$a" "$invar" status "$1" --wait 20 >own.log 2>&1 || fail "$1 is not well"; }
end() { kill -INT "$run"; wait "$run" || fail "the cell did not end in order"; pids=(); }
bound() { on "$a" ss -Hltun | awk '{print $5}' | sed 's/%[^:]*//; s/:[0-9]*$//' | sort -u; }

begin alone.yaml
head -n 3 own.log | tr '\n' ' ' >head.log
says '^cell lonely: unsecured, .*can read and +command it' head.log
on "$a" "$invar" status alone.yaml --json >json.log
says '"secured": false' json.log
on "$a" "$invar" top alone.yaml --once --no-topics >top.log
head -n 1 top.log >head.log
says '^cell lonely: unsecured, ' head.log
bound >bound.log
grep -qx 127.0.0.1 bound.log || fail "nothing listens on the loopback"
! grep -vxE '127\.0\.0\.1|239\.255\.0\.1' bound.log || fail "a socket of the cell hears a network"  # the group: joined on loopback
status=0; on "$b" "$invar" status --domain 9 --peer 10.79.0.11 --wait 3 >other.log 2>&1 || status=$?
((status == 1)) || fail "another PC: status $status"
says 'no cell answers' other.log
end

begin open.yaml
bound >bound.log
says '^10.79.0.11$' bound.log
on "$b" "$invar" status --domain 9 --peer 10.79.0.11 --wait 20 >other.log 2>&1 || fail "another PC does not see the open cell"
head -n 1 other.log >head.log
says '^cell lonely: unsecured, ' head.log
end
echo passed
