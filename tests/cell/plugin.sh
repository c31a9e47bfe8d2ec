#!/usr/bin/env bash
# A component outside the tree: installed package, its own CMakeLists, loaded and run in a cell; its output is what a
# first-order low-pass makes of its recorded input.
# plugin.sh BUILD_DIR SOURCE_DIR
set -euo pipefail
build=$1 source=$2
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
cmake --install "$build" --prefix "$folder/installed" >/dev/null
# The IDL is there for other implementations of DDS: Cyclone's compiler, which is not ours, takes every file.
mkdir "$folder/foreign"
for idl in "$source"/idl/*.idl; do
  cmp "$idl" "$folder/installed/share/invar/idl/${idl##*/}"
  idlc -o "$folder/foreign" -I "$folder/installed/share/invar/idl" "$folder/installed/share/invar/idl/${idl##*/}"
done
grep -q invar_stage_AxisCommand_desc "$folder/foreign/stage.h"
cmake -S "$source/examples/low_pass" -B "$folder/build" -G Ninja -DCMAKE_PREFIX_PATH="$folder/installed" >/dev/null
ninja -C "$folder/build" >/dev/null
mkdir "$folder/cell"; cd "$folder/cell"
cp "$source"/examples/low_pass/*.yaml "$source/deployment/profiles.yaml" "$folder/build/liblow_pass.so" .
source "$source/tests/support/claims.sh"
sed -i "s/^domain: .*/domain: $domain/" cell.yaml
invar=$folder/installed/bin/invar
"$invar" check cell.yaml
# Pictures need a library of their own, which is installed beside the program.
printf 'P5 64 48 255\n' >dark.pgm; head -c 3072 /dev/zero >>dark.pgm
"$invar" measure droplets --image dark.pgm --output drops.csv | grep -q '^dark.pgm: 0 droplets'
mv "$folder/installed/lib/invar" "$folder/installed/lib/gone"
if "$invar" measure droplets --image dark.pgm --output drops.csv 2>said; then echo "measured without its library"; exit 1; fi
grep -q 'lib/invar/libinvar_vision.so: cannot be loaded' said && [[ $(wc -l <said) == 1 ]] || { cat said; exit 1; }
mv "$folder/installed/lib/gone" "$folder/installed/lib/invar"
"$invar" types --plugin liblow_pass.so low_pass | tee types
grep -Eq '^raw +input +invar::stage::AxisFeedback +realtime' types
grep -Eq '^cutoff +number +Hz +\[0\.1, 450\] +100 +yes +-3 dB corner' types
"$invar" run cell.yaml --simulated --duration 1
"$invar" export out/recording.mcap --out tables
ls tables
/usr/bin/python3 - tables/*world*feedback_x*.csv tables/*smooth*smooth*.csv <<'P'
import csv, math, sys
def read(name):
    rows = list(csv.DictReader(open(name)))
    column = lambda start: next(k for k in rows[0] if k.startswith(start))
    return [(int(r[column("at.time_ns")]), float(r[column("position")])) for r in rows]
raw, smooth = (dict(read(n)) for n in sys.argv[1:3])
share = -math.expm1(-2 * math.pi * 20.0 * 0.001)
y, worst, n = None, 0.0, 0
for t in sorted(raw):
    y = raw[t] if y is None else y + share * (raw[t] - y)
    if t in smooth:
        worst, n = max(worst, abs(smooth[t] - y)), n + 1
print(f"{n} samples, largest difference from the closed form {worst:.3g} m")
sys.exit(0 if n > 800 and worst < 1e-12 else 1)
P
echo "passed"
