#!/usr/bin/env bash
# A component outside the tree: installed package, its own CMakeLists, loaded and run in a cell; its output is what a first-order
# low-pass makes of its recorded input. The READMEs of the other examples are run by tests/tutorials.py.
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
sed -i "s/^domain: .*/domain: $domain/; s|build/liblow_pass|liblow_pass|" cell.yaml
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

# A library of another build is refused before anything of it runs: each of these would leave a file when it is loaded.
refused() {  # refused LIBRARY WORDS
  local status=0
  "$invar" types --plugin "$1" >said 2>&1 || status=$?
  cat said
  [[ $status == 2 && $(wc -l <said) == 1 ]] && grep -q -- "$2" said || { echo "$1 was not refused with: $2"; exit 1; }
  [[ ! -e ran ]] || { echo "something of $1 ran"; exit 1; }
}
cat >../other.cpp <<'C'
#include "core/component/plugin.hpp"
#include <cstdio>
static const int ran = std::fclose(std::fopen("ran", "w"));
INVAR_PLUGIN(registry) { (void)registry; (void)ran; }
C
flags=(-std=c++20 -shared -fPIC -I "$folder/installed/include/invar")
c++ "${flags[@]}" ../other.cpp -o same.so
"$invar" types --plugin "$PWD/same.so" >/dev/null && [[ -e ran ]] || { echo "one of the same build is not loaded"; exit 1; }
rm ran
c++ "${flags[@]}" -DINVAR_ABI_HEADERS='"0123456789abcdef"' ../other.cpp -o other.so
refused other.so "built against another Invar (headers 0123456789abcdef, here [0-9a-f]*); build it again with this installation"
c++ "${flags[@]}" -D_GLIBCXX_USE_CXX11_ABI=0 ../other.cpp -o strings.so
refused strings.so "string-abi 0, here 1"
printf '#include <stdio.h>\n__attribute__((constructor)) static void f(void) { fclose(fopen("ran", "w")); }\n' >../foreign.c
cc -shared -fPIC ../foreign.c -o foreign.so
refused foreign.so "carries no stamp of Invar"
echo "no library" >text.so; refused text.so "it is no shared library"
: >empty.so; refused empty.so "it is no shared library"
head -c 2000 same.so >cut.so; refused cut.so "carries no stamp of Invar"
ln -s nowhere.so link.so; refused link.so "a link to a file that does not exist"
refused nothing.so "no such file"
mkdir folder.so; refused folder.so "no such file"
# Headers that were changed after the installation: find_package sees it.
echo "// changed" >>"$folder/installed/include/invar/core/component/port.hpp"
cmake -S "$source/examples/low_pass" -B "$folder/changed" -G Ninja -DCMAKE_PREFIX_PATH="$folder/installed" >/dev/null
ninja -C "$folder/changed" >/dev/null
refused "$folder/changed/liblow_pass.so" "built against another Invar (headers"
sed -i "s|liblow_pass.so|$folder/changed/liblow_pass.so|" cell.yaml
status=0; "$invar" check cell.yaml >said 2>&1 || status=$?
cat said
[[ $status == 2 ]] && grep -q "cell.yaml:[0-9]*: plugins" said && grep -q "build it again" said || { echo "check does not say it"; exit 1; }
echo "passed"
