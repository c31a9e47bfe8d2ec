#!/usr/bin/env bash
# A program of the plant on Cyclone DDS orders a calibration of the shipped cell, by the wall clock, and hears its readings, its
# progress and the model that the loop then uses. What it heard is what the cell's own recorder has: each reading, and the checksum.
# cyclone_job.sh INVAR SOURCE_DIR CYCLONE_JOB
set -euo pipefail
source "$(dirname "$0")/../support/alone.sh"
alone "$@"
program=$3
cp -r "$source"/deployment/* .
fail() { echo "$*"; tail -n 20 ./*.log; exit 1; }
{
  sed 's/^domain: .*/domain: 77/; s/^time: .*/time: real/; /^          - name: calibrate-geometry/,/steep/d' xy-table.yaml |
    awk -v job="$source/tests/support/short_job.yaml" '{ print } /^        jobs:/ { while ((getline line < job) > 0) print line }'
} | sed 's/calibrate-geometry: calibration/short: calibration/' >cell.yaml
"$invar" check cell.yaml >check.log 2>&1 || fail "the cell is not sound"
export CYCLONEDDS_URI='<CycloneDDS><Domain><General><Interfaces><NetworkInterface name="lo" multicast="true"/></Interfaces></General></Domain></CycloneDDS>'
"$invar" run cell.yaml >run.log 2>&1 & run=$!; pids+=("$run")
"$invar" status cell.yaml --wait 20 >status.log || fail "the cell is not well"
"$program" 77 short >job.log 2>&1 || fail "the job failed"
kill -INT "$run"
wait "$run" || fail "the cell did not end in order"
pids=()
"$invar" export out/xy-table/recording.mcap --out tables >export.log
tail -n 2 job.log
/usr/bin/python3 - <<'P' || fail "the program did not hear what the recorder has"
import csv, glob, re
said = open("job.log").read()
heard = int(re.search(r"^end 2 after (\d+) readings", said, re.M)[1])
rows = sum(1 for _ in csv.reader(open(glob.glob("tables/*laser*reading*.csv")[0]))) - 1
model = re.findall(r"^model (\d) (\d+)", said, re.M)[-1]
checksum = int(model[1])
statuses = list(csv.DictReader(open(glob.glob("tables/*compensation*status*.csv")[0])))
column = next(key for key in statuses[0] if key.startswith("geometric_checksum"))
print(f"{heard} readings heard, {rows} recorded at the end of the cell; model in use {checksum}")
assert 100 < heard <= rows, (heard, rows)
assert checksum != 0 and checksum in {int(float(row[column])) for row in statuses}, checksum
assert float(re.findall(r"^job \d ([\d.]+)", said, re.M)[-1]) == 1.0
P
echo passed
