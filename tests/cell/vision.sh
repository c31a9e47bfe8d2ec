#!/usr/bin/env bash
# Camera and vision as two processes: in simulated time no frame is lost and two runs are equal; by the wall clock over
# DDS the same marks are found; every bad input gets one line.
# vision.sh BUILD_DIR SOURCE_DIR
set -euo pipefail
build=$1 source=$2 invar=$1/bin/invar
folder=$(mktemp -d); pid=
trap '[[ -z $pid ]] || kill "$pid" 2>/dev/null || true; rm -rf "$folder"' EXIT
cp "$source"/tests/data/vision/* "$source/deployment/profiles.yaml" "$folder"; cd "$folder"
source "$source/tests/support/claims.sh"
sed -i "s/^domain: .*/domain: $domain/; s/^profiles: .*/profiles: profiles.yaml/" cell.yaml

for run in one two; do
  "$invar" run cell.yaml --duration 2 >/dev/null
  "$invar" export out/recording.mcap --out "$run" >/dev/null
  rm -r out
done
for table in frame droplets status; do
  cmp one/*"$table".csv two/*"$table".csv || { echo "two runs differ in $table"; exit 1; }
done

# The marks stand in marks.yaml, the scale in camera.yaml; 0.05 px is 0.65 um.
/usr/bin/python3 - one/*droplets.csv one/*status.csv <<'P'
import csv, math, re, sys
marks = [(float(x) + 0.03, float(y) + 0.01) for x, y in re.findall(r"at: \[(.*?), (.*?)\]", open("marks.yaml").read())]
frames = list(csv.DictReader(open(sys.argv[1])))
worst, sound = 0.0, 0
for frame in frames:
    found = []
    for i in range(int(frame["droplets.length"])):
        if frame[f"droplets[{i}].status"] == "DROPLET_SOUND":
            found.append([float(frame[f"droplets[{i}].position[{k}] [m]"]) for k in range(2)])
    for mark in marks:
        worst = max(worst, min(math.dist(mark, at) for at in found))
    sound += len(found)
last = list(csv.DictReader(open(sys.argv[2])))[-1]
print(f"{len(frames)} frames, {sound} droplets, farthest {worst * 1e6:.3f} um from its mark, {last['frames_dropped']} frames lost")
assert len(frames) >= 19 and sound == 5 * len(frames) and worst < 0.65e-6
assert last["frames_dropped"] == "0" and int(last["frames_received"]) >= 19
P

# By the wall clock, from another process yet.
"$invar" run cell.yaml --real-time >real-time.log 2>&1 & pid=$!
"$invar" echo cell.yaml vision.droplets --count 5 --json --wait 30 >seen.json || { cat real-time.log; exit 1; }
for child in $(cat "/proc/$pid/task/$pid/children"); do
  process=$(tr '\0' ' ' <"/proc/$child/cmdline" | sed 's/.*--process \([a-z]*\).*/\1/')
  has=$(grep -c libopencv_core "/proc/$child/maps" || true)
  [[ $process == record ]] && wanted=0 || wanted=1
  [[ $((has > 0)) == "$wanted" ]] || { echo "process $process: OpenCV is in $has mappings"; exit 1; }
done
kill -INT "$pid"; wait "$pid" || true; pid=
/usr/bin/python3 - <<'P'
import json, math, re
marks = [(float(x) + 0.03, float(y) + 0.01) for x, y in re.findall(r"at: \[(.*?), (.*?)\]", open("marks.yaml").read())]
lines = [json.loads(line) for line in open("seen.json")]
worst = 0.0
for line in lines:
    frame = line.get("value", line)
    at = [d["position"] for d in frame["droplets"] if d["status"] == "DROPLET_SOUND"]
    assert len(at) == 5, at
    worst = max(worst, max(min(math.dist(mark, p) for p in at) for mark in marks))
print(f"{len(lines)} frames over DDS, farthest {worst * 1e6:.3f} um")
assert len(lines) == 5 and worst < 0.65e-6
P

# What is wrong is said in one line, and nothing starts. fault 'sed expression' 'words' [file]
fault() {
  cp cell.yaml bad.yaml; sed -i "$1" bad.yaml
  if "$invar" check bad.yaml >/dev/null 2>said; then echo "accepted: $1"; exit 1; fi
  [[ $(wc -l <said) == 1 ]] && grep -qF "$2" said || { echo "expected one line with: $2; it said:"; cat said; exit 1; }
}
echo 'scale: {value: 1.29e-5, unit: kg}' >kilo.yaml
printf 'scale: {value: 1.29e-5, unit: m/px}\nchecksum: "00000000"\n' >edited.yaml
mkdir empty
fault 's/camera: camera.yaml/camera: none.yaml/' 'file `none.yaml` does not exist'
fault 's/camera: camera.yaml/camera: kilo.yaml/' 'kilo.yaml:1: scale'
fault 's/camera: camera.yaml/camera: edited.yaml/' 'edited.yaml: its checksum does not fit'
fault 's/simulated_camera/folder_camera/; /mount: {x: 0.03/d; /ruler:/d; /dust/d; /light/d; /vignetting/d; s/rate: 10$/folder: nowhere/' 'file `nowhere` does not exist'
fault 's/simulated_camera/folder_camera/; /mount: {x: 0.03/d; /ruler:/d; /dust/d; /light/d; /vignetting/d; s/rate: 10$/folder: empty/' '`empty` holds no picture'

# A camera that is not there: the process ends with one line that names it.
sed "s|^hosts:|plugins: [$build/lib/libv4l_camera.so]\nhosts:|; s/simulated_camera/v4l_camera/; /ruler:/d; /dust/d; /light/d
     /vignetting/d; s|rate: 10\$|device: /dev/video-none|" cell.yaml |
  awk '/type: v4l_camera/ { skip = 1 } skip && /mount:/ { skip = 0; next } { print }' >device.yaml
"$invar" check device.yaml >/dev/null
if "$invar" run device.yaml --process eye --real-time >said 2>&1; then echo "ran without a camera"; exit 1; fi
grep -q '/dev/video-none: there is no such device' said || { cat said; exit 1; }
echo "passed"
