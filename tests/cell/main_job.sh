#!/usr/bin/env bash
# The main job, twice: the error falls on lines that were not fitted, and simulated time repeats bit for bit.
# main_job.sh INVAR SOURCE_DIR
set -euo pipefail
invar=$1 source=$2
source "$(dirname "$0")/own_cell.sh"
own_cell xy-table "$source" 15020

for run in one two; do
  mkdir "$folder/$run"; cd "$folder/$run"
  "$invar" run ../deployment/xy-table.yaml --job calibrate-geometry | tee summary
  for file in lines.csv verify_before.csv verify_after.csv compensation.yaml report.html recording.mcap; do
    test -s "out/xy-table/$file" || { echo "$file was not written"; exit 1; }
  done
done
cd "$folder"
for file in lines.csv verify_before.csv verify_after.csv; do
  cmp "one/out/xy-table/$file" "two/out/xy-table/$file" || { echo "two runs differ in $file"; exit 1; }
done

before=$(rms one/out/xy-table/verify_before.csv); after=$(rms one/out/xy-table/verify_after.csv)
echo "error on lines not fitted: $before um before, $after um after"
awk -v b="$before" -v a="$after" 'BEGIN { exit !(b > 5 && a < 0.3) }' || { echo "the compensation did not do its work"; exit 1; }

# The recording holds the heater's trace, and it reached 30 degC.
"$invar" export one/out/xy-table/recording.mcap --out tables >/dev/null
table=$(ls tables/*thermal*state*.csv | head -n 1)
awk -F, 'NR == 1 { for (i = 1; i <= NF; i++) if ($i ~ /^temperature/) c = i } END { exit !($c > 29 && $c < 31) }' "$table" ||
  { echo "the slide is not at 30 degC at the end"; exit 1; }

# The recording through the motion process's components once more: they write what they wrote.
(cd one && "$invar" replay ../deployment/xy-table.yaml out/xy-table/recording.mcap --into motion --json >replayed &&
  /usr/bin/python3 -c 'import json; r = json.load(open("replayed")); assert r["equal"] == r["recorded"] > 0 and r["outputs"]') ||
  { echo "the replay differs from the recording"; exit 1; }
echo "passed"
