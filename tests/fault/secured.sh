#!/usr/bin/env bash
# A secured cell on two PCs (network namespaces): who has a certificate of the cell looks and commands as its role allows; whoever has
# none, or one of another authority, over, revoked, or of another process, gets no sample, moves nothing and stops nothing.
# secured.sh INVAR SOURCE_DIR
set -euo pipefail
source "$(dirname "$0")/../interop/two_namespaces.sh"
as_root "$@"
invar=$1 source=$2
two_namespaces 10.79.0.11 10.79.0.12
cp "$source/deployment/profiles.yaml" "$source/deployment/maps/heater.yaml" "$folder"
cd "$folder"
cat >cell.yaml <<'Y'
invar_cell: 1
name: guarded
domain: 9
profiles: profiles.yaml
security: {keys: keys, operators: [anna, ben], viewers: [wall, old]}
hosts:
  left: {address: 10.79.0.11}
  right: {address: 10.79.0.12}
processes:
  loop:
    host: left
    realtime: {rate: 100}
    components:
      heater: {type: simulated_heater, map: heater.yaml, port: 1502}
      thermal: {type: thermal, setpoint: 30, modbus: {port: 1502, map: heater.yaml}}
  watch: {host: right, rate: 10, components: {supervisor: {type: supervisor}}}
  tape: {host: right, rate: 10, components: {recorder: {type: recorder, out: out}}}
Y
on() { local pc=$1; shift; ip netns exec "$pc" "$@"; }
fail() { echo "$*"; tail -n 30 ./*.log; exit 1; }
says() { grep -qE "$1" "$2" || fail "$2 does not say: $1"; }
is() { local wanted=$1 log=$2 status=0; shift 2; "$@" >"$log" 2>&1 || status=$?; ((status == wanted)) || fail "$* ended with $status, not $wanted: $(cat "$log")"; }
faketime() { local by=$1; shift; LD_PRELOAD=/usr/lib/x86_64-linux-gnu/faketime/libfaketimeMT.so.1 FAKETIME=$by FAKETIME_DONT_FAKE_MONOTONIC=1 "$@"; }
setpoint() { is 0 setpoint.log on "$b" "$invar" param get cell.yaml thermal setpoint --wait 20; cat setpoint.log; }

# The keys: that of `old` is over, that of `ben` revoked before the cell starts. Ben keeps the list of an earlier day.
faketime -3d "$invar" keys cell.yaml --days 1 >keys.log
for name in loop watch tape anna ben wall launcher-left launcher-right; do "$invar" keys cell.yaml --renew $name >keys.log; done
cp -r keys ben-keys
"$invar" keys cell.yaml --revoke ben >keys.log
says '^old +viewer .* over' keys.log
says '^ben +operator .* revoked' keys.log
"$invar" keys cell.yaml --out foreign-keys >keys.log  # other authorities, the same names
grep -v '^security' cell.yaml >open.yaml
sed 's/keys: keys/keys: foreign-keys/' cell.yaml >foreign.yaml
sed 's/keys: keys/keys: ben-keys/' cell.yaml >ben.yaml

ip netns exec "$a" "$invar" run cell.yaml >left.log 2>&1 & left=$!; pids+=("$left")
ip netns exec "$b" "$invar" run cell.yaml >right.log 2>&1 & right=$!; pids+=("$right")
for pc in "$a" "$b"; do is 0 status.log on "$pc" "$invar" status cell.yaml --as wall --wait 20; done
head -n 1 status.log >head.log
says '^cell guarded: secured by certificates' head.log
is 0 echo.log on "$b" "$invar" echo cell.yaml thermal.state --as wall --count 3 --wait 20
echo "members on both PCs: passed"

# Four at a time come and go. Fast DDS 2.9 stood still for ever where one took its leave while another sent its keys.
crowd=()
for who in 1 2 3 4; do
  (for _ in {1..12}; do on "$b" "$invar" param get cell.yaml thermal setpoint --as anna --wait 20 >"crowd$who.log" 2>&1 || exit 1; done) & crowd+=($!)
done
for one in "${crowd[@]}"; do wait "$one" || fail "a command of many at once had no answer"; done
echo "many commanders at once: passed"

# Roles: an operator commands, a viewer does not.
is 0 set.log on "$b" "$invar" param set cell.yaml thermal setpoint 31 --as anna --wait 20
before=$(setpoint)
[[ $before == *31* ]] || fail "an operator's setpoint did not arrive: $before"
is 2 wall.log on "$b" "$invar" param set cell.yaml thermal setpoint 77 --as wall --wait 5
says 'parameter_request.: the certificate of .wall. does not permit to write it' wall.log
is 2 nobody.log on "$b" "$invar" status cell.yaml --as carl
says '`carl` is no operator and no viewer of this cell' nobody.log
echo "roles: passed"

# Strangers: each looks, and commands. None is answered, and its own programs say so.
stranger() {  # stranger NAME CELL OPTIONS...: the programs of one who should not be there
  local name=$1 cell=$2; shift 2
  local tries=() try
  is 1 "$name-status.log" on "$b" "$invar" status "$cell" --wait 3 "$@" & tries+=($!)
  is 1 "$name-echo.log" on "$b" "$invar" echo "$cell" thermal.state --count 1 --wait 3 "$@" & tries+=($!)
  is 1 "$name-set.log" on "$b" "$invar" param set "$cell" thermal setpoint 66 --wait 3 "$@" & tries+=($!)
  for try in "${tries[@]}"; do wait "$try" || fail "$name was answered"; done
  says 'no cell answers' "$name-status.log"
  ! grep -q temperature "$name-echo.log" || fail "$name got a sample"
  [[ $(setpoint) == "$before" ]] || fail "$name moved the setpoint"
  echo "$name: passed"
}
stranger open open.yaml
stranger foreign foreign.yaml
stranger revoked ben.yaml --as ben
is 2 own.log on "$b" "$invar" status cell.yaml --as ben
says 'ben/certificate.pem: is revoked; `invar keys CELL --renew ben`' own.log
is 2 own.log on "$b" "$invar" status cell.yaml --as old
says 'old/certificate.pem: was valid until .* UTC; `invar keys CELL --renew old`' own.log
is 1 over.log faketime -2.5d on "$b" "$invar" status ben.yaml --as old --wait 3  # a PC whose clock stands still
says 'no cell answers' over.log
echo "over: passed"

# The key of one process in another's place: what it was not given to write, it does not write.
cat >thief.yaml <<'Y'
invar_cell: 1
name: guarded
domain: 9
profiles: profiles.yaml
security: {keys: keys}
hosts: {left: {address: 10.79.0.11}}
processes:
  watch:
    rate: 10
    components:
      thermal: {type: thermal, setpoint: 55, modbus: {host: 127.0.0.1, port: 1503, map: heater.yaml}}
Y
is 2 thief.log on "$a" "$invar" run thief.yaml --process watch
says 'watch/permissions.p7s: does not permit to write `cell/guarded/thermal/state`' thief.log
is 2 thief.log on "$a" "$invar" run thief.yaml --process watch --launcher $$  # without that look at the rights
says 'topic `cell/guarded/thermal/.*the certificate of `watch` does not permit to (read|write) it' thief.log
echo "another's component: passed"

[[ $(setpoint) == "$before" ]] || fail "the setpoint moved"
is 0 status.log on "$a" "$invar" status cell.yaml --as anna --wait 20
kill -INT "$left" "$right"
wait "$left" || fail "the left PC did not end in order"
wait "$right" || fail "the right PC did not end in order"
pids=()
"$invar" recording info out/*.mcap >tape.log 2>&1 || fail "no recording"
says 'cell/guarded/thermal/state' tape.log
echo passed
