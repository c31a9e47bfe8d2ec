#!/usr/bin/env bash
# A heater's device (a process of its own, behind Modbus TCP) and its loop, killed (-9) in turn. The device gone: the loop lets
# go, says so, and heats again when it is back. The loop gone: the device's own watchdog switches the heater off, as mbpoll
# sees; a new loop heats again. Three processes over DDS and Modbus, by the wall clock.
# device.sh INVAR SOURCE_DIR
set -euo pipefail
invar=$1 source=$2
folder=$(mktemp -d)
source "$source/tests/support/claims.sh"
cp "$source/deployment/profiles.yaml" "$source/deployment/maps/heater.yaml" "$folder"
cat > "$folder/cell.yaml" <<C
invar_cell: 1
name: warm
domain: $domain
profiles: profiles.yaml
hosts: {pc: {address: 127.0.0.1}}
processes:
  device: {host: pc, rate: 20, components: {heater: {type: simulated_heater, map: heater.yaml, port: $port}}}
  heat:
    host: pc
    rate: 20
    components:
      thermal: {type: thermal, modbus: {port: $port, map: heater.yaml}, setpoint: 45, power_limit: 100}
  recorder: {host: pc, rate: 20, components: {recorder: {type: recorder}}}
C
cd "$folder"
declare -A pid
trap 'kill -9 "${pid[@]}" 2>/dev/null || true; rm -rf "$folder"' EXIT
start() { "$invar" run cell.yaml --process "$1" >>"$1.log" 2>&1 & pid[$1]=$!; }
# coil 0: enable; holding register 0: power. References of mbpoll count from 1.
enabled() { mbpoll -m tcp -p "$port" -t 0 -r 1 -1 127.0.0.1 2>/dev/null | grep -q '^\[1\]:.*1'; }
power() { mbpoll -m tcp -p "$port" -t 4 -r 1 -1 127.0.0.1 2>/dev/null | sed -n 's/^\[1\]:[[:space:]]*//p'; }
heats() { enabled && [[ $(power) -gt 0 ]]; }
off() { ! enabled && [[ $(power) == 0 ]]; }
thermal() { [[ $("$invar" echo cell.yaml thermal.state --count 1 --json --wait 20 2>/dev/null) == *"$1"* ]]; }
wait_for() {
  local what=$1 end=$((SECONDS + 40)); shift
  while ((SECONDS < end)); do if "$@"; then return; fi; sleep 0.05; done
  echo "waited in vain for: $what"; cat ./*.log; exit 1
}
start recorder; start heat
wait_for "no temperature without a device" thermal '"temperature":null'
start device
wait_for "the heater to heat" heats

kill -9 "${pid[device]}"
wait_for "the loop to let go of a device that is gone" thermal '"enabled":false'
thermal '"stale":true' || { echo "a device that is gone gives readings"; exit 1; }
start device
wait_for "the heater to heat again with its device back" heats
wait_for "sound readings" thermal '"stale":false'

# Another master makes the device wait ten seconds for a heartbeat: its owner takes that back.
mbpoll -m tcp -p "$port" -t 4 -r 3 -1 127.0.0.1 10000 >/dev/null
waits_a_second() { mbpoll -m tcp -p "$port" -t 4 -r 3 -1 127.0.0.1 2>/dev/null | grep -Eq '^\[3\]:[[:space:]]*1000$'; }
wait_for "the watchdog's second to be set again" waits_a_second
heats || { echo "not heating"; exit 1; }
kill -9 "${pid[heat]}"
wait_for "the device's watchdog to switch the heater off" off
sleep 1; off || { echo "it does not stay off"; exit 1; }
start heat
wait_for "a new loop to heat" heats

kill -INT "${pid[heat]}"; wait "${pid[heat]}"
off || { echo "a loop that ended in order left the heater on"; exit 1; }
kill -INT "${pid[device]}" "${pid[recorder]}"; wait "${pid[recorder]}"
cat ./*.log
"$invar" export out/recording.mcap --out tables >/dev/null
cat tables/*notices*.csv > said
grep -q "does not answer" said && grep -q "answers again" said || { echo "nobody says that the device was gone"; cat said; exit 1; }
# What it has not measured it does not show: the readings are 20 degC and more, or none.
/usr/bin/python3 - tables/*thermal*state*.csv <<'P'
import csv, math, sys
rows = list(csv.DictReader(open(sys.argv[1])))
key = next(k for k in rows[0] if k.startswith("temperature"))
values = [float(row[key] or "nan") for row in rows]
assert any(math.isnan(v) for v in values), "no sample from before the first reading"
assert all(math.isnan(v) or v > 15.0 for v in values), min(v for v in values if not math.isnan(v))
print(len(values), "temperatures, from", min(v for v in values if not math.isnan(v)), "to", max(values[-3:]))
P
echo "passed"
