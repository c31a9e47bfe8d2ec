#!/usr/bin/env bash
# Every process of a running cell is killed (-9) in turn, shared memory left behind; each is started again and works, the
# supervisor says what was lost, and no recording is overwritten.
# kill_processes.sh INVAR SOURCE_DIR
set -euo pipefail
invar=$1 source=$2
folder=$(mktemp -d)
cp -r "$source/deployment" "$folder/deployment"
domain=$((100 + RANDOM % 100)); port=$((20000 + RANDOM % 20000))
echo "domain $domain, port $port"
cell=$folder/deployment/xy-table.yaml
sed -i "s/^domain: .*/domain: $domain/; s/15020/$port/g" "$cell"
cd "$folder"
"$invar" run "$cell" --real-time >log 2>&1 &
launcher=$!
trap 'kill "$launcher" 2>/dev/null || true; wait "$launcher" 2>/dev/null || true; rm -rf "$folder"' EXIT

process() { pgrep -P "$launcher" -f -- "--process $1 " || true; }
wait_for() {  # wait_for WHAT COMMAND...: up to 30 s
  local what=$1; shift
  for _ in $(seq 300); do if "$@"; then return; fi; sleep 0.1; done
  echo "waited in vain for: $what"; cat log; exit 1
}
alive() { [[ -n $(process "$1") ]]; }
replaced() { local now; now=$(process "$1"); [[ -n $now && $now != "$2" ]]; }

for name in motion heat calibration recorder supervisor; do wait_for "$name" alive "$name"; done
wait_for "the recording" test -s out/xy-table/recording.mcap
sleep 3
for name in recorder motion heat calibration supervisor; do
  pid=$(process "$name")
  kill -9 "$pid"
  wait_for "another $name" replaced "$name" "$pid"
done
sleep 5  # they find each other again
kill -INT "$launcher"
wait "$launcher" || { echo "the cell did not stop in order"; cat log; exit 1; }
cat log
for name in motion heat calibration recorder supervisor; do
  grep -q "process \`$name\` ended with status 137; starting it again" log || { echo "$name was not started again"; exit 1; }
  grep -Eq "^$name +[0-9.]+ Hz +[1-9]" log || { echo "$name did not run to the end"; exit 1; }
done
test "$(ls out/xy-table/recording*.mcap | wc -l)" = 2 || { echo "a recording was overwritten"; exit 1; }
"$invar" recording info out/xy-table/recording-1.mcap  # cut off by the kill: readable up to there
echo "passed"
