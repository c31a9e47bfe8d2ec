#!/usr/bin/env bash
# tools/run as a user calls it, in a copy of the tree and on the build that is there: one table of all commands, which names
# reports and a recording that exist; wrong options end it with the program's own words; recordings beside the checkout are compared.
# run_tool.sh BUILD_DIR SOURCE_DIR
set -euo pipefail
build=$1 source=$2
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
mkdir "$folder/checkout"
cp -r "$source/tools" "$source/deployment" "$folder/checkout"
source "$source/tests/support/claims.sh"
sed -i "s/^domain: .*/domain: $domain/; s/15020/$port/g" "$folder"/checkout/deployment/{xy-table,mismatch,print-cell}.yaml
# The print job without what has tests of its own (main_job.sh, print_job.sh).
sed -i "s/15030/$((port + 1))/g; s/{prints: 4, pause: 3}/{prints: 0}/; /first: calibrate-geometry/d" "$folder/checkout/deployment/print-cell.yaml"
export INVAR_BUILD=$build INVAR_SHARED=${INVAR_SHARED:-$source/../shared}
cd "$folder"

status=0
checkout/tools/run --no-such-option >wrong 2>&1 || status=$?
cat wrong
[[ $status == 2 ]] && grep -q -- "--no-such-option" wrong || { echo "a wrong option ended with status $status"; exit 1; }

checkout/tools/run >summary 2>&1 || { cat summary; exit 1; }
cat summary
for words in 'job +calibrate-geometry: done' 'error before +rms [0-9.]+ um' 'error after +rms [0-9.]+ nm' 'heater +[0-9.]+ degC' '^6 lines, 288 readings' \
  '^motion +1000 Hz +[0-9]+ ' '^time +' '^  force ripple ' '^  coulomb friction ' '^\.\.\. patched +rms .* times less' \
  'from 20 mm +[0-9.]+ um before, [0-9.]+ um after'; do
  grep -Eq "$words" summary || { echo "the summary lacks: $words"; exit 1; }
done
"$source/tests/readme.py" figures summary checkout/out/xy-table  # README.md shows what this run shows
for what in report recording; do
  file=$(sed -n "s/^$what  *//p" summary | head -n 1)
  [[ $file == "$folder"/checkout/out/* && -s $file ]] || { echo "the $what that is named does not exist: $file"; exit 1; }
done
while read -r file; do
  [[ -s $file || -s checkout/$file ]] || { echo "the report that is named does not exist: $file"; exit 1; }
done < <(sed '1,/^== reports/d' summary)
while read -r file; do "$build/bin/invar" recording info "$file" >/dev/null; done < <(sed -n "s/^recording  *//p" summary)

if [[ -d $INVAR_SHARED/data ]]; then
  for set in linear-axis-emps tclab-two-heaters; do
    [[ -d $INVAR_SHARED/data/$set ]] || { echo "not here, so not compared: $set"; continue; }
    ls "checkout/out/compare-$set"/*.html >/dev/null || { echo "$set was not compared"; exit 1; }
  done
else
  echo "no recordings beside the checkout, so none was compared"
fi
echo "passed"
