#!/usr/bin/env bash
# The whole print job over six processes: camera calibrated, printed, measured, identified, printed again; twice, bit for bit.
# print_job.sh INVAR SOURCE_DIR
set -euo pipefail
invar=$1 source=$2
source "$(dirname "$0")/own_cell.sh"
own_cell print-cell "$source" 15030
# The geometric calibration in front has a test of its own (main_job.sh).
sed -i "s/{prints: 4, pause: 3}/{prints: 1}/; /first: calibrate-geometry/d" "$folder/deployment/print-cell.yaml"

for run in one two; do
  mkdir "$folder/$run"; cd "$folder/$run"
  "$invar" run ../deployment/print-cell.yaml --job print | tee summary
  for file in camera.yaml droplets.csv dispenser_compensation.yaml droplets_after.csv drift.csv before_2mm.png after_20mm.png report.html recording.mcap; do
    test -s "out/print-cell/$file" || { echo "$file was not written"; exit 1; }
  done
done
cd "$folder"
for file in droplets.csv droplets_after.csv drift.csv; do
  cmp "one/out/print-cell/$file" "two/out/print-cell/$file" || { echo "two runs differ in $file"; exit 1; }
done

# Against the oracle: the head of print-cell.yaml (2.0, 118.2 um, 0.304 deg towards 0.9739 deg, 2 m/s less 0.2 % a second, 0.3 ms),
# from where it jetted.
/usr/bin/python3 - one/out/print-cell <<'P'
import csv, math, re, sys
folder = sys.argv[1]
def rows(name):
    with open(f"{folder}/{name}") as file:
        for row in csv.DictReader(file):
            yield {key.split(" ")[0]: float(value) for key, value in row.items()}
slope = math.tan(math.radians(0.304)); azimuth = math.radians(0.9739)
for height in (2e-3, 20e-3):
    error, oracle, was = [], [], []
    for r in rows("droplets.csv"):
        if abs(r["height"] - height) < 1e-9:
            was.append(math.hypot(r["landed_x"] - r["target_x"], r["landed_y"] - r["target_y"]))
    for r in rows("droplets_after.csv"):
        if abs(r["height"] - height) > 1e-9: continue
        error.append(math.hypot(r["landed_x"] - r["target_x"], r["landed_y"] - r["target_y"]))
        lead = 3e-4 + height / (2 * math.exp(-2e-3 * r["t"]))
        x = r["landed_x"] - r["jetted_x"] - 2.0e-6 - height * slope * math.cos(azimuth) - r["stage_velocity_x"] * lead
        y = r["landed_y"] - r["jetted_y"] - 118.2e-6 - height * slope * math.sin(azimuth)
        oracle.append(math.hypot(x, y))
    rms = lambda e: 1e6 * math.sqrt(sum(v * v for v in e) / len(e))
    print(f"{1e3 * height:g} mm: {rms(was):.1f} um before, {rms(error):.1f} um after, {rms(oracle):.1f} um with the truth, {len(error)} droplets")
    assert len(error) >= 19 and rms(error) < 1.25 * rms(oracle) and rms(was) > 4 * rms(error)
scale = float(re.search(r"value: ([\d.e-]+)", open(f"{folder}/camera.yaml").read())[1])
print(f"scale {scale:.6g} m/px, {abs(scale / 1.29e-5 - 1):.1e} off")
assert abs(scale / 1.29e-5 - 1) < 2e-4
P

# A controller that stops answering: the job fails with the reason.
cat >"$folder/deployment/gone.yaml" <<'Y'
invar_modbus_faults: 1
faults:
  - {at: 12, for: 1000, do: refuse}
Y
sed "s/        map: maps\/pneumatic.yaml/&\n        faults: gone.yaml/" "$folder/deployment/print-cell.yaml" >"$folder/deployment/fault.yaml"
mkdir "$folder/fault"; cd "$folder/fault"
if "$invar" run ../deployment/fault.yaml --job print >log 2>&1; then echo "the job did not notice that the controller is gone"; exit 1; fi
grep -q "not jetted: the pneumatic controller does not answer\|the pressure does not reach its band" log || { cat log; exit 1; }
grep "failed" log
echo "passed"
